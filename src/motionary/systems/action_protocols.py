"""What systems of action labels offer, as types; see :mod:`motionary.systems.protocols`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from motionary.corpus.context import Context
from motionary.motion import Motion


class ActionToMotion(Protocol):
    """Motions of action labels.

    Attributes:
        context: of the corpus that it learned from.
        actions: known labels, the coarse ones first.
        variants: names of the models, the usual one first.
    """

    context: Context
    actions: tuple[str, ...]
    variants: tuple[str, ...]

    def labels_of(self, variant: str) -> tuple[str, ...]:
        """The labels that one model knows."""
        ...

    def starts_from_pose(self, variant: str) -> bool:
        """Whether a model needs at least a first pose."""
        ...

    def act(
        self,
        plans: Sequence[Sequence[tuple[str, int]]],
        seeds: Sequence[int],
        *,
        starts: Sequence[np.ndarray] | None = None,
        variant: str | None = None,
        scale: float = 1.0,
    ) -> list[Motion]:
        """A motion for each plan, a list of (action, frames) that follow each other; see the system."""
        ...

    def between(self, action: str, frames: int, seeds: tuple[int, int], steps: int, scale: float = 1.0) -> list[Motion]:
        """Motions whose first latent goes from that of one seed to that of another."""
        ...


class ActionClassifier(Protocol):
    """Which action a motion shows.

    Attributes:
        hash: names its weights.
    """

    hash: str

    @property
    def labels(self) -> dict[str, tuple[str, ...]]:
        """Class names of the verdicts that were trained, by "coarse" and "fine"."""
        ...

    def judge(self, motions: Sequence[np.ndarray], kind: str = "coarse") -> tuple[np.ndarray, np.ndarray]:
        """Logits (N, classes) and features (N, dim) of joints (T, J, 3) each."""
        ...
