"""A choice between candidates by summed evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

SURE = 0.95  # a choice less probable than this is said to be thin


@dataclass(frozen=True)
class Choice:
    """The most probable candidate, its probability and the runner-up."""

    value: str
    probability: float
    other: str

    @property
    def sure(self) -> bool:
        """Whether nobody needs to be told."""
        return self.probability >= SURE


def choose(names: Sequence[str], scores: np.ndarray) -> Choice:
    """The candidate of the highest log-odds score; probabilities are the scores' softmax."""
    weights = np.exp(scores - np.max(scores))
    best, other = (int(i) for i in np.argsort(-weights, kind="stable")[:2])
    return Choice(names[best], float(weights[best] / weights.sum()), names[other])
