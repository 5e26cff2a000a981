"""Motion tokens of shifted windows."""

import numpy as np
import torch

from motionary.corpus.token_store import TokenStore
from motionary.evaluation.codebooks import shifted_tokens
from motionary.nn.layers import seeded
from motionary.systems.codec import BatchedCodec
from motionary.systems.tm2t.tokenizer import Tokenizer, TokenizerConfig


def test_shifted_tokens_are_those_of_the_rest_of_each_training_window(corpus):
    with seeded(0):
        model = Tokenizer(TokenizerConfig(codebook_size=50, code_dim=8, width=16, fine_width=16), corpus.context).eval()
        model.quantizer.codebook.normal_(std=0.1)
    tokens = TokenStore.collect(BatchedCodec(model).encode([corpus.features(i) for i in range(len(corpus))]))
    stores = shifted_tokens(corpus, tokens, model, 3)
    assert len(stores) == 3
    assert stores[0] is tokens
    train = set(corpus.rows("train").tolist())
    differ = 0
    for shift, store in enumerate(stores[1:], start=1):
        assert len(store) == len(corpus)
        for row in range(len(corpus)):
            if row not in train:
                assert len(store[row]) == 0
                continue
            rest = torch.from_numpy(np.array(corpus.features(row)[shift:]))[None]
            whole = rest[:, : rest.shape[1] // 4 * 4]
            np.testing.assert_array_equal(store[row], model.encode(whole)[0].numpy())
            differ += store[row].tolist() != tokens[row][: len(store[row])].tolist()
    assert differ
    assert shifted_tokens(corpus, tokens, model, 1) == [tokens]
