"""Windows with labels of style and action, drawn so that rare combinations are seen too."""

from __future__ import annotations

import numpy as np
import torch

from motionary.corpus.batch import Batch
from motionary.corpus.datasets import gather
from motionary.corpus.store import Corpus
from motionary.errors import InputError


class Labeled:
    """Chosen windows of a corpus with their labels, one entry each.

    Args:
        corpus: that holds the windows.
        rows: of the corpus.
        window: frames; longer windows of the corpus give a stretch of this many, shorter ones come whole.
        random: draw the stretch anew each time; otherwise it is the middle one.
        balance: how much rarer (style, action) combinations are drawn more often: a combination's share is
            proportional to its count to the power of 1 - balance. 0 draws every window alike, 1 every combination.
    """

    def __init__(
        self, corpus: Corpus, rows: np.ndarray, window: int, *, random: bool = True, balance: float = 0.0
    ) -> None:
        if window < 1:
            raise InputError("window", window, "must be at least 1 frame")
        if not 0 <= balance <= 1:
            raise InputError("balance", balance, "must lie in 0..1")
        self.corpus, self.rows, self.window, self.random = corpus, np.asarray(rows), window, random
        self.lengths = np.minimum(corpus.clips.length[self.rows], window)
        self.style, self.action = corpus.style_ids[self.rows], corpus.action_ids[self.rows]
        self.weights = _weights(self.style, self.action, balance) if balance else None

    def __len__(self) -> int:
        return len(self.rows)

    def collate(self, indices: np.ndarray, rng: np.random.Generator) -> Batch:
        """Batch of the given entries: clip, motion (B, T, D), frames, style, action."""
        return self._stretches(indices, rng)

    def _stretches(self, entries: np.ndarray, rng: np.random.Generator) -> Batch:
        rows, count = self.rows[entries], self.lengths[entries]
        spare = self.corpus.clips.length[rows] - count
        start = rng.integers(0, spare + 1) if self.random else spare // 2
        motion = gather(self.corpus.frames, self.corpus.clips.offset[rows] + start, count, int(count.max()))
        labels = {"style": torch.from_numpy(self.style[entries]), "action": torch.from_numpy(self.action[entries])}
        return Batch(torch.from_numpy(rows), torch.from_numpy(motion), torch.from_numpy(count), **labels)


def _weights(style: np.ndarray, action: np.ndarray, balance: float) -> np.ndarray:
    _, place, count = np.unique(np.stack([style, action], 1), axis=0, return_inverse=True, return_counts=True)
    weights = count[place.reshape(-1)].astype(np.float64) ** -balance
    return weights / weights.sum()
