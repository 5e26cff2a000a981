"""Local motion: features without the root's velocities, which are predicted from it (thesis 5.2.1-5.2.2)."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from motionary.corpus.context import Context
from motionary.features import packed, width

ROOT = ("root_angular", "root_linear")  # the turning about the vertical, then the velocity on the ground, x and z


class LocalMotion:
    """Takes the root's velocities and local motion out of feature frames, and puts them together again.

    Attributes:
        root_dim, dim: features of the root's velocities and of local motion.
        root, local: their columns.
    """

    def __init__(self, context: Context):
        self.root, self.local = context.columns(*ROOT), context.other_columns(*ROOT)
        self.root_dim, self.dim = width(self.root), width(self.local)
        together = np.concatenate([np.arange(context.dim)[part] for part in (self.root, self.local)])
        self._places = packed(np.argsort(together).tolist())

    def join(self, root: Tensor, local: Tensor) -> Tensor:
        """(..., root_dim) and (..., dim) -> feature frames (..., D)."""
        return torch.cat([root, local], -1)[..., self._places]
