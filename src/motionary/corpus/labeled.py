"""Windows with labels of style and action, drawn so that rare combinations are seen too."""

from __future__ import annotations

import numpy as np
import torch

from motionary.corpus.batch import Batch
from motionary.corpus.datasets import balanced, gather
from motionary.corpus.store import Corpus
from motionary.errors import InputError


class Labeled:
    """Chosen windows of a corpus with their labels, one entry each.

    Args:
        corpus: that holds the windows.
        rows: of the corpus.
        window: frames; longer windows of the corpus give a stretch of this many, shorter ones come whole.
        random: draw the stretch anew each time; otherwise it is the middle one.
        balance: how much more often rare combinations of style and action are drawn: see
            :func:`motionary.corpus.datasets.balanced`.
    """

    def __init__(
        self, corpus: Corpus, rows: np.ndarray, window: int, *, random: bool = True, balance: float = 0.0
    ) -> None:
        if window < 1:
            raise InputError("window", window, "must be at least 1 frame")
        self.corpus, self.rows, self.window, self.random = corpus, np.asarray(rows), window, random
        self.lengths = np.minimum(corpus.clips.length[self.rows], window)
        self.style, self.action = corpus.style_ids[self.rows], corpus.action_ids[self.rows]
        combinations = np.unique(np.stack([self.style, self.action], 1), axis=0, return_inverse=True)[1]
        self.weights = balanced(combinations.reshape(-1), balance)

    def __len__(self) -> int:
        return len(self.rows)

    def collate(self, indices: np.ndarray, rng: np.random.Generator) -> Batch:
        """Batch of the given entries: clip, motion (B, T, D), frames, style, action."""
        return self._stretches(indices, rng)

    def _stretches(self, entries: np.ndarray, rng: np.random.Generator) -> Batch:
        spare = self.corpus.clips.length[self.rows[entries]] - self.lengths[entries]
        return self._stretches_at(entries, rng.integers(0, spare + 1) if self.random else spare // 2)

    def _stretches_at(self, entries: np.ndarray, start: np.ndarray) -> Batch:
        rows, count = self.rows[entries], self.lengths[entries]
        motion = gather(self.corpus.frames, self.corpus.clips.offset[rows] + start, count, int(count.max()))
        labels = {"style": torch.from_numpy(self.style[entries]), "action": torch.from_numpy(self.action[entries])}
        return Batch(torch.from_numpy(rows), torch.from_numpy(motion), torch.from_numpy(count), **labels)
