"""A choice between candidates by summed evidence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

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


def choose(names: Sequence[str], scores: Sequence[float]) -> Choice:
    """The candidate of the highest log-odds score; probabilities are the scores' softmax."""
    best, other = sorted(range(len(names)), key=lambda i: -scores[i])[:2]
    return Choice(names[best], 1 / sum(math.exp(score - scores[best]) for score in scores), names[other])
