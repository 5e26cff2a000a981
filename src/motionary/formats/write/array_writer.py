"""Motions as numpy files: .npy holds joint positions alone, .npz all that is known."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.files import atomic_file, save_array
from motionary.formats.read.smpl import SMPL_OFFSETS, SMPL_ROOT
from motionary.motion import Motion, Skeleton, foot_contacts
from motionary.motion.rigging import Rig, to_rig
from motionary.motion.rotations import euler_to_rotmat, rotmat_to_unitquat, unitquat_to_rotmat, unitquat_to_rotvec


def write_npy(motion: Motion, path: str | os.PathLike, force: bool = True) -> Path:
    """Write joint positions (T, J, 3) float32 alone: no rate, no joint names."""
    with atomic_file(path, force) as temporary:
        save_array(temporary, motion.positions)
    return Path(path)


def write_npz(motion: Motion, path: str | os.PathLike, force: bool = True, layout: str = "motionary") -> Path:
    """Write what is known of a motion.

    Args:
        motion: what to write.
        path: where.
        force: replace an existing file.
        layout: "motionary": positions (T, J, 3) m, rotations (T, J, 4) xyzw if known, contacts (T-1, 4), fps and
            skeleton (JSON); "amass": poses (T, 156) as rotation vectors of SMPL-H's 52 joints, trans (T, 3), betas
            (16,), gender and mocap_framerate, z up, as Blender add-ons and AMASS viewers open.

    Raises:
        InputError: another layout, or a motion that has no place on SMPL's body.
    """
    if layout not in _LAYOUTS:
        raise InputError("layout", layout, f"must be one of {', '.join(_LAYOUTS)}")
    with atomic_file(path, force) as temporary, open(temporary, "wb") as file:
        arrays: dict[str, Any] = _LAYOUTS[layout](motion)
        np.savez_compressed(file, **arrays)
    return Path(path)


def _everything(motion: Motion) -> dict[str, np.ndarray]:
    arrays = {
        "positions": motion.positions,
        "fps": np.array(motion.fps, np.float64),
        "skeleton": np.array(json.dumps(motion.skeleton.to_json())),
    }
    if motion.rotations is not None:
        arrays["rotations"] = motion.rotations
    if motion.frames > 1:
        arrays["contacts"] = np.asarray(foot_contacts(motion), np.float32)
    return arrays


def _amass(motion: Motion) -> dict[str, np.ndarray]:
    """On the joints of SMPL's mean shape, of which smpl22's are the first 22; the hands stay at rest."""
    body = to_rig(motion, Rig.of(Skeleton.named("smpl22").with_offsets(SMPL_OFFSETS)))
    assert body.rotations is not None
    up = euler_to_rotmat(0, np.pi / 2)  # (x, y, z) with y up -> (x, -z, y) with z up
    turned = body.rotations.astype(np.float64)
    turned[:, 0] = rotmat_to_unitquat(up @ unitquat_to_rotmat(turned[:, 0]))
    poses = np.zeros((motion.frames, 52, 3))
    poses[:, :22] = unitquat_to_rotvec(turned)
    return {
        "poses": poses.reshape(motion.frames, -1),
        # The model turns about its pelvis, which rests here and not at the origin.
        "trans": body.positions[:, 0].astype(np.float64) @ up.T - SMPL_ROOT,
        "betas": np.zeros(16),
        "gender": np.array("neutral"),
        "mocap_framerate": np.array(motion.fps, np.float64),
    }


_LAYOUTS = {"motionary": _everything, "amass": _amass}
