"""What stays in 32 bits while the matrix products around it are computed in fewer (torch.autocast)."""

from __future__ import annotations

import torch
from torch import Tensor

_NARROW = (torch.bfloat16, torch.float16)


def full_precision(like: Tensor) -> torch.autocast:
    """A context in which operations on the device of `like` keep the precision of what they are given."""
    return torch.autocast(like.device.type, enabled=False)


def narrow_type(like: Tensor) -> torch.dtype | None:
    """The type that the active autocast gives matrix products on the device of `like`, None where there is none."""
    kind = like.device.type
    return torch.get_autocast_dtype(kind) if torch.is_autocast_enabled(kind) else None


def widened(x: Tensor) -> Tensor:
    """`x` in at least 32 bits: for sums, differences, exponentials and all that a loss is made of."""
    return x.float() if x.dtype in _NARROW else x
