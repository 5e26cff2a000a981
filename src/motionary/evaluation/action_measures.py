"""What is measured of judged motions of actions: FID, accuracy, diversity (Eq. 3.19), multimodality (Eq. 3.20)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from motionary.metrics.classification import accuracy
from motionary.metrics.distribution import diversity, frechet_distance, halves_distance

REAL, TRAINING = "real motions", "training motions"


class PairCounts(Protocol):
    """How many pairs are drawn."""

    @property
    def diversity_pairs(self) -> int:
        """Pairs of Eq. 3.19."""
        ...

    @property
    def multimodality_pairs(self) -> int:
        """Pairs a class of Eq. 3.20."""
        ...


@dataclass(frozen=True, eq=False)
class Judged:
    """Motions and what the judge makes of them.

    Attributes:
        joints: (T, J, 3) each.
        ids: (N,) labels that were asked for.
        said: (N,) labels that the judge sees.
        features: (N, dim) of the judge.
    """

    joints: Sequence[np.ndarray]
    ids: np.ndarray
    said: np.ndarray
    features: np.ndarray

    def take(self, rows: np.ndarray) -> Judged:
        """Some of them."""
        return Judged([self.joints[i] for i in rows], self.ids[rows], self.said[rows], self.features[rows])


def values_of(made: Judged, real: Judged, pairs: PairCounts, rng: np.random.Generator) -> dict[str, float]:
    """One repetition for motions of any origin: FID against `real`, accuracy, diversity, multimodality."""
    return {"fid": frechet_distance(made.features, real.features), **_spread(made, pairs, rng)}


def real_values(real: Judged, pairs: PairCounts, rng: np.random.Generator) -> dict[str, float]:
    """The same for real motions; their FID is the distance of two random halves, the least that can be told apart."""
    return {"fid": halves_distance(real.features, rng), **_spread(real, pairs, rng)}


def class_multimodality(features: np.ndarray, ids: np.ndarray, pairs: int, rng: np.random.Generator) -> float:
    """Eq. 3.20: mean distance over classes of `pairs` pairs of features (N, dim) of one class, ids (N,).

    Two subsets of a class are drawn, each without repetition; a class with fewer than `pairs` motions gives as many
    pairs as it has motions, and one with a single motion none.
    """
    means = []
    for label in np.unique(ids):
        own = np.flatnonzero(ids == label)
        if len(own) >= 2:
            first, second = (rng.permutation(own)[: min(pairs, len(own))] for _ in range(2))
            means.append(np.linalg.norm(features[first] - features[second], axis=-1).mean())
    return float(np.mean(means)) if means else 0.0


def _spread(judged: Judged, pairs: PairCounts, rng: np.random.Generator) -> dict[str, float]:
    count = min(pairs.diversity_pairs, len(judged.features))
    return {
        "accuracy": accuracy(judged.said, judged.ids),
        "diversity": diversity(judged.features, count, rng),
        "multimodality": class_multimodality(judged.features, judged.ids, pairs.multimodality_pairs, rng),
    }
