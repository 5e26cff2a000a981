"""Motions as numpy files: .npy holds joint positions alone, .npz all that is known."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np

from motionary.files import atomic_file
from motionary.motion import Motion, foot_contacts


def write_npy(motion: Motion, path: str | os.PathLike, force: bool = True) -> Path:
    """Write joint positions (T, J, 3) float32 alone: no rate, no joint names."""
    with atomic_file(path, force) as temporary, open(temporary, "wb") as file:
        np.lib.format.write_array(file, np.ascontiguousarray(motion.positions), allow_pickle=False)
    return Path(path)


def write_npz(motion: Motion, path: str | os.PathLike, force: bool = True) -> Path:
    """Write positions (T, J, 3) m, rotations (T, J, 4) xyzw if known, contacts (T-1, 4), fps and skeleton (JSON)."""
    arrays = {
        "positions": motion.positions,
        "fps": np.float64(motion.fps),
        "skeleton": np.array(json.dumps(motion.skeleton.to_json())),
    }
    if motion.rotations is not None:
        arrays["rotations"] = motion.rotations
    if motion.frames > 1:
        arrays["contacts"] = np.asarray(foot_contacts(motion), np.float32)
    with atomic_file(path, force) as temporary, open(temporary, "wb") as file:
        np.savez_compressed(file, **arrays)
    return Path(path)
