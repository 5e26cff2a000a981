"""Codecs between motions and feature vectors, and where they keep what."""

from __future__ import annotations

from collections.abc import Callable

from motionary.errors import InputError
from motionary.features.columns import Columns, columns, other_columns, packed, width
from motionary.features.humanml3d import HumanML3D, recover_positions, recover_positions_torch
from motionary.features.protocol import UNIT, Codec
from motionary.features.rifke import Rifke
from motionary.features.rotation import Rotations
from motionary.motion import Skeleton

__all__ = [
    "CODECS",
    "UNIT",
    "Codec",
    "Columns",
    "HumanML3D",
    "Rifke",
    "Rotations",
    "codec",
    "columns",
    "other_columns",
    "packed",
    "recover_positions",
    "recover_positions_torch",
    "width",
]

# Every codec by the name that corpora and models keep; a further one is an entry here.
CODECS: dict[str, Callable[[Skeleton], Codec]] = {"humanml3d": HumanML3D, "rifke": Rifke, "rotation": Rotations}


def codec(name: str, skeleton: Skeleton) -> Codec:
    """The codec of a name (`CODECS`) on a skeleton.

    Raises:
        InputError: no codec of this name.
    """
    if name not in CODECS:
        raise InputError("codec", name, f"one of {', '.join(CODECS)}")
    return CODECS[name](skeleton)
