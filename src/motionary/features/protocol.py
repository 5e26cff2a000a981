"""What a codec offers to corpora and networks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Protocol

import numpy as np

from motionary.motion import Motion, Skeleton

if TYPE_CHECKING:
    import torch

# Feature frames to a code or a token in every system of the papers: networks halve time twice, windows are cut to
# multiples of it.
UNIT = 4


class Codec(Protocol):
    """Motions on one skeleton to feature frames and back.

    Attributes:
        skeleton: of the motions.
        dim: features of a frame.
        slices: columns of each group of features; the groups tile all columns, in any order. Groups that networks ask
            for by name: "root_angular" (1) and "root_linear" (2), the root's velocities; "positions", three for each
            joint but the root, in metres; "contacts" of the feet. Others have names of their codec's own.
    """

    skeleton: Skeleton
    dim: int
    slices: Mapping[str, slice]

    def encode(self, motion: Motion) -> np.ndarray:
        """(T - 1, dim) float32 features of T frames."""
        ...

    def decode(self, features: np.ndarray, rotations: bool = False, fps: float = 20.0) -> Motion:
        """The motion of (T, dim) features, from the origin and heading 0 on."""
        ...

    def root_path(self, features: torch.Tensor) -> torch.Tensor:
        """Where the root stands on the ground, x and z in metres: (..., T, dim) -> (..., T, 2), differentiable."""
        ...
