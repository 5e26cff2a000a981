"""A choice between candidates by summed evidence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

SURE = 0.95  # a choice less probable than this is said to be thin


@dataclass(frozen=True)
class Choice:
    """The most probable candidate, its probability and the runner-up.

    Attributes:
        seen: log-odds by candidate of what was seen alone, 0 for the best.
    """

    value: str
    probability: float
    other: str
    seen: Mapping[str, float]

    @property
    def sure(self) -> bool:
        """Whether the choice is probable enough (`SURE`) to be taken without a warning."""
        return self.probability >= SURE


def choose(names: Sequence[str], seen: Sequence[float], usual: Mapping[str, float]) -> Choice:
    """The candidate of the highest log-odds, of what was seen and what is usual; probabilities are their softmax."""
    scores = [float(score) + usual.get(name, 0.0) for name, score in zip(names, seen, strict=True)]
    best, other = sorted(range(len(names)), key=lambda i: -scores[i])[:2]
    most = max(seen)
    alone = {name: float(score - most) for name, score in zip(names, seen, strict=True)}
    return Choice(names[best], 1 / sum(math.exp(score - scores[best]) for score in scores), names[other], alone)
