"""A choice between candidates by summed evidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

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


def choose(
    names: Sequence[str],
    seen: Sequence[float] | np.ndarray,
    usual: Mapping[str, float],
    without: Sequence[np.ndarray] = (),
    deceived: float = 0.0,
) -> Choice:
    """The candidate of the highest log-odds, of what was seen and what is usual; probabilities are their softmax.

    Args:
        names: of the candidates.
        seen: log-odds by candidate of all that was seen.
        usual: log-odds by name before any look.
        without: log-odds by candidate of what was seen, each time without one kind of evidence that may deceive.
        deceived: how probable it is, of each kind, that it does; the choice is the less probable by what it owes to it.
    """
    scores = np.array([seen, *without]) + [usual.get(name, 0.0) for name in names]
    best = int(scores[0].argmax())
    shares = np.exp(scores - scores.max(1, keepdims=True))
    shares /= shares.sum(1, keepdims=True)
    share = shares[0] + deceived * (shares[1:] - shares[0]).sum(0)
    other = max((i for i in range(len(names)) if i != best), key=lambda i: share[i])
    most = max(seen)
    alone = {name: float(score - most) for name, score in zip(names, seen, strict=True)}
    return Choice(names[best], float(share[best]), names[other], alone)
