"""Codecs between motions and feature vectors."""

from __future__ import annotations

from motionary.errors import InputError
from motionary.features.humanml3d import HumanML3D, recover_positions, recover_positions_torch
from motionary.motion import Skeleton

__all__ = ["CODECS", "HumanML3D", "codec", "recover_positions", "recover_positions_torch"]

CODECS = {"humanml3d": HumanML3D}


def codec(name: str, skeleton: Skeleton) -> HumanML3D:
    """The codec of a name (`CODECS`) on a skeleton.

    Raises:
        InputError: no codec of this name.
    """
    if name not in CODECS:
        raise InputError("codec", name, f"one of {', '.join(CODECS)}")
    return CODECS[name](skeleton)
