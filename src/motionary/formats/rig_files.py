"""A character's rig from a file: its skeleton, and a pose in which it stands."""

from __future__ import annotations

import os
from pathlib import Path

from motionary.errors import InputError
from motionary.formats.dispatch import DAMAGED_RIG, about, foreseen
from motionary.motion import Motion, Skeleton
from motionary.motion.rigging import Rig


def read_rig(rig: Skeleton | Motion | Rig | str | os.PathLike) -> Rig:
    """The rig of a skeleton, a motion, or a .bvh or .glb file.

    Raises:
        InputError: another extension, a file that holds no rig, missing roles, or no pose known in which it stands.
    """
    if isinstance(rig, Rig):
        return rig
    if isinstance(rig, Skeleton):
        return Rig.of(rig)
    if isinstance(rig, Motion):
        return Rig.of(rig.skeleton, rig.rotations)
    suffix = Path(rig).suffix.lower()
    if suffix == ".bvh":
        from motionary.formats.read.bvh import read_bvh

        with foreseen(rig, DAMAGED_RIG), about(rig):
            return read_rig(read_bvh(rig))
    if suffix == ".glb":
        from motionary.formats.write.glb_rig import Character

        with foreseen(rig, DAMAGED_RIG), about(rig):
            return Character.read(rig).rig
    raise InputError("rig", rig, "must be a .bvh or .glb file, a motion or a skeleton")
