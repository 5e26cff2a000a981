"""Readers of motion files: one per extension, loaded only when a file asks for it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from motionary.formats.dispatch import function_of, given
from motionary.motion import Motion, name_joints

READERS = {
    ".bvh": "motionary.formats.read.bvh:read_bvh",
    ".amc": "motionary.formats.read.acclaim:read_amc",
    ".npy": "motionary.formats.read.arrays:read_npy",
    ".npz": "motionary.formats.read.arrays:read_npz",
}


def read_motion(
    path: str | os.PathLike, mapping: Path | str | Mapping[str, str] | None = None, **options: Any
) -> Motion:
    """Read a motion file by its extension: .bvh, .amc (with its .asf), .npy, .npz.

    Args:
        path: the file.
        mapping: for a rig that is not known, its joint's name by role (a dict or a JSON file): see
            :func:`motionary.motion.name_joints`.
        options: for that format; ``fps`` for all, ``skeleton`` for arrays, ``unit``, ``up`` and ``skip_first`` for BVH
            and AMC, ``asf`` for AMC. None means not given.

    Returns:
        The motion in metres, y up.

    Raises:
        InputError: unknown extension, or a file that breaks a rule: file, value and rule in one line.
    """
    reader = function_of(path, READERS, "read")
    motion = reader(path, **given(reader, path, options))
    if mapping is None:
        return motion
    return name_joints(motion, mapping)
