"""What stylization learns from: two stretches of one clip, and one of any other (thesis 5.2.2, "Learning Scheme")."""

from __future__ import annotations

import numpy as np

from motionary.corpus.batch import Batch
from motionary.corpus.labeled import Labeled
from motionary.corpus.store import Corpus
from motionary.errors import InputError


class Triples(Labeled):
    """Entries of :class:`Labeled`, three stretches each: z1 and z2 of the entry's window, z3 of a window drawn from
    all entries with the same weights.

    A batch of B entries holds 3 B items: all z1, then all z2, then all z3. A stretch has at most two thirds of its
    window's frames (in whole units, at least two), so that z1 and z2 always start at different frames: equal stretches
    have equal style codes, whatever was learned. Windows too short for two different stretches are left out.

    Args:
        corpus, rows, window, balance: see :class:`Labeled`.

    Raises:
        InputError: no row is long enough.
    """

    def __init__(self, corpus: Corpus, rows: np.ndarray, window: int, *, balance: float = 0.0) -> None:
        rows, shortest = np.asarray(rows), 2 * corpus.context.unit  # a step of content is two units
        rows = rows[corpus.clips.length[rows] > shortest]
        if not len(rows):
            raise InputError("triples", "no window", f"at least one must have more than {shortest} frames")
        super().__init__(corpus, rows, window, balance=balance)
        whole = corpus.clips.length[self.rows] * 2 // 3 // corpus.context.unit * corpus.context.unit
        self.lengths = np.minimum(self.lengths, np.maximum(whole, shortest))

    def collate(self, indices: np.ndarray, rng: np.random.Generator) -> Batch:
        """Batch of 3 B items: clip, motion (3 B, T, D), frames, style, action."""
        others = rng.choice(len(self.rows), len(indices), p=self.weights)
        first, second = self._two_starts(indices, rng)
        third = rng.integers(0, self._spare(others) + 1)
        return self._stretches_at(np.concatenate([indices, indices, others]), np.concatenate([first, second, third]))

    def _two_starts(self, entries: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Each first start is as likely as any other; the second lies at least a quarter of the free frames away."""
        starts = self._spare(entries) + 1
        apart = (starts + 3) // 4
        first = rng.integers(0, starts)
        return first, (first + rng.integers(apart, starts - apart + 1)) % starts

    def _spare(self, entries: np.ndarray) -> np.ndarray:
        return self.corpus.clips.length[self.rows[entries]] - self.lengths[entries]
