"""Captions of some sources are drawn more often than others (`data.source_weights`)."""

from __future__ import annotations

import numpy as np


class CaptionWeights:
    """Draws one caption for each entry, in proportion to the captions' weights.

    Args:
        weight: (captions,) of every caption of the corpus.
        first, last: (entries,) the captions of entry i are rows first[i] to last[i], at least one.

    Attributes:
        entries: (entries,) the largest weight of each entry's captions, or None where all captions weigh the same: a
            motion that only index phrases describe is drawn as seldom as they are.
    """

    def __init__(self, weight: np.ndarray, first: np.ndarray, last: np.ndarray):
        self.first, self.last = first, last
        own = [weight[a:b].max() for a, b in zip(first, last, strict=True)]
        equal = len(weight) == 0 or bool((weight == weight[0]).all())
        self.entries = None if equal else np.array(own, dtype=np.float64)
        self._sums = None if equal else np.concatenate([[0.0], np.cumsum(weight, dtype=np.float64)])

    def draw(self, entries: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """A caption row for each of `entries`."""
        first, last = self.first[entries], self.last[entries]
        if self._sums is None:
            return rng.integers(first, last)
        drawn = rng.uniform(self._sums[first], self._sums[last])
        return np.clip(np.searchsorted(self._sums, drawn, side="right") - 1, first, last - 1)

    def times(self, weights: np.ndarray | None) -> np.ndarray | None:
        """(entries,) draw probabilities: `weights` (None: all alike) times the entries' own; None for all alike."""
        if self.entries is None:
            return weights
        product = self.entries if weights is None else self.entries * weights
        return product / product.sum()
