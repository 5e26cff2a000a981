"""Snippet codes of every window in their principal components, which a generator of vectors learns from."""

from __future__ import annotations

import numpy as np
import torch

from motionary.corpus.store import Corpus
from motionary.corpus.token_store import TokenStore
from motionary.nn.layers import length_mask
from motionary.nn.padding import by_length, pad
from motionary.systems.codec import BatchedCodec
from motionary.systems.masked.masked_autoregression import MaskedAutoregression

MOST = 4096  # training windows that the components are fitted to


def snippet_components(corpus: Corpus, model: MaskedAutoregression) -> tuple[TokenStore, float]:
    """Fits the model's components to the training windows.

    Returns:
        the components (S, components) of every window, and the share of the codes' variance that they keep.
    """
    rows = corpus.rows("train", None)
    kept = model.take_components(_snippets(corpus, model, rows[:: -(-len(rows) // MOST)]))
    features = [corpus.features(i) for i in range(len(corpus))]
    found = BatchedCodec(model).encode(features, progress="codes")
    return TokenStore.collect(found), kept


@torch.no_grad()
def _snippets(corpus: Corpus, model: MaskedAutoregression, rows: np.ndarray) -> torch.Tensor:
    """(N, snippet_dim) the snippet codes of windows, one after the other."""
    parts = []
    for chosen in by_length(corpus.clips.length[rows].tolist(), 64):
        batch, frames = pad([corpus.features(i) for i in rows[chosen]])
        codes = model.encoder(batch, frames)
        parts.append(codes[length_mask(frames // corpus.context.unit, codes.shape[1])])
    return torch.cat(parts)
