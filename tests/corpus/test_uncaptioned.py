"""Windows without captions among captioned ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from motionary.corpus.batches import Batches, Pairs, TokenStore
from motionary.corpus.preprocess import preprocess
from motionary.corpus.store import Corpus
from motionary.corpus.uncaptioned import WithUncaptioned


@pytest.fixture(scope="module")
def half(tmp_path_factory, folder_of) -> Corpus:
    """Ten captioned clips of 3 s and 30 of 3 to 9 s that nobody captioned."""
    root: Path = tmp_path_factory.mktemp("half") / "data"
    lines = [
        {"motion": f"motions/{i:02d}.npy", "fps": 20, "captions": [{"text": f"walk {i}"}] if i < 10 else []}
        for i in range(40)
    ]
    folder_of(root, lines, {f"motions/{i:02d}.npy": 60 + 4 * max(0, i - 10) for i in range(40)})
    out = root.parent / "corpus"
    config = {"source": "folder", "roots": [str(root)], "workers": 1, "split": "clip", "mirror": False}
    preprocess(config, out, progress=False)
    return Corpus.open(out)


@pytest.fixture(scope="module")
def tokens(half) -> TokenStore:
    """Two layers; each token tells the row of its window and its place there."""
    lengths = half.clips.length // 4
    return TokenStore.collect([np.stack([np.full(n, row), np.arange(n)], 1) for row, n in enumerate(lengths)])


def batches(dataset) -> list:
    drawn = Batches(dataset, 8, length_sorted=True)
    return [batch for epoch in range(30) for batch in drawn.epoch(epoch)]


def test_a_share_of_the_windows_are_stretches_of_uncaptioned_ones_of_training(half, tokens):
    pairs = Pairs(half, "train", tokens, motion=False, drop_unit=0)
    found, bare = batches(WithUncaptioned(pairs, half, tokens, 0.5)), set(half.rows("train", False).tolist())
    assert len(bare) > 10
    textless = np.concatenate([batch.textless.numpy() for batch in found])
    assert 0.4 < textless.mean() < 0.6
    seen, starts = set(), set()
    for batch in found:
        for at, row in enumerate(batch.clip.tolist()):
            count = int(batch.token_count[at])
            told = batch.tokens[at].numpy()
            assert (told[:count, 0] == row).all()  # the tokens are those of the window that is named
            assert (np.diff(told[:count, 1]) == 1).all()  # one after the other
            assert (told[count:] == 0).all()
            assert (row in bare) == bool(batch.textless[at])
            if row in bare:
                seen.add(row)
                starts.add(int(told[0, 1]))
    assert len(seen) > 0.7 * len(bare)
    assert len(starts) > 10


def test_the_captioned_ones_and_a_share_of_zero_change_nothing(half, tokens):
    pairs = Pairs(half, "train", tokens, motion=False)
    for plain, same in zip(batches(pairs), batches(WithUncaptioned(pairs, half, tokens, 0.0)), strict=True):
        assert not same.textless.any()
        assert np.array_equal(plain.tokens, same.tokens)
    for plain, some in zip(batches(pairs), batches(WithUncaptioned(pairs, half, tokens, 0.5)), strict=True):
        kept = ~some.textless
        assert np.array_equal(plain.tokens[kept], some.tokens[kept])
        assert np.array_equal(plain.words, some.words)


def test_where_everything_is_captioned_nothing_is_replaced(corpus):
    held = corpus.rows("train", False)
    tokens = TokenStore.collect([np.zeros(0 if row in held else n // 4) for row, n in enumerate(corpus.clips.length)])
    found = batches(WithUncaptioned(Pairs(corpus, "train", tokens, motion=False), corpus, tokens, 1.0))
    assert not any(batch.textless.any() for batch in found)


def test_vectors_stay_vectors(half, tokens):
    """Codes of no codebook: the same windows with half a unit added."""
    vectors = TokenStore(tokens.tokens.astype(np.float32) + 0.5, tokens.offsets)
    whole, halves = (WithUncaptioned(Pairs(half, "train", t, motion=False), half, t, 0.5) for t in (tokens, vectors))
    for plain, found in zip(batches(whole), batches(halves), strict=True):
        valid = torch.arange(plain.tokens.shape[1]) < plain.token_count[:, None]
        assert found.tokens.dtype == torch.float32
        assert torch.equal(found.tokens[valid], plain.tokens[valid] + 0.5)
        assert (found.tokens[~valid] == 0).all()
