"""What stylization learns from: two stretches of one clip, and one of any other (thesis 5.2.2, "Learning Scheme")."""

from __future__ import annotations

import numpy as np

from motionary.corpus.batch import Batch
from motionary.corpus.labeled import Labeled


class Triples(Labeled):
    """Entries of :class:`Labeled`, three stretches each: z1 and z2 of the entry's window, z3 of a window drawn from
    all entries with the same weights.

    A batch of B entries holds 3 B items: all z1, then all z2, then all z3. Windows shorter than `window` come whole.
    """

    def collate(self, indices: np.ndarray, rng: np.random.Generator) -> Batch:
        """Batch of 3 B items: clip, motion (3 B, T, D), frames, style, action."""
        others = rng.choice(len(self.rows), len(indices), p=self.weights)
        return self._stretches(np.concatenate([indices, indices, others]), rng)
