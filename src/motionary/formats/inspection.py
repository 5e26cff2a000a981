"""What is in a motion file and how it was read, for people who wonder what came of theirs."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from motionary.formats.measure import body_of
from motionary.formats.read import Reading, read_motion_with
from motionary.motion import Motion

_STATURE = 1.32  # of leg and trunk together
_LIMBS = {"left_knee": "thigh", "left_ankle": "shin", "left_elbow": "upper arm", "left_wrist": "forearm"}


def inspect_motion(
    path: str | os.PathLike, mapping: Path | str | Mapping[str, Any] | None = None, **options: Any
) -> tuple[dict[str, Any], Motion]:
    """What a file holds, what was decided about it and on what evidence; and the motion. Arguments as `read_motion`.

    Returns:
        By name: "frames", "fps", "seconds", "joints" (names in order), "parents" (by joint), "roles" (joint by role),
        "roles_by", "rotations" (whether it has them), "up", "unit" (metres), "mirrored", "skipped_first", "told" (what
        was not measured), "probability" and "evidence" of each measurement (log-odds by candidate, 0 for the best),
        "bones" (metres from the parent, by joint, the median over time), "stature" (m, by legs and trunk, None where
        roles are not known), "lowest" and "highest" (m, over the motion), "notes".

    Raises:
        InputError: as `read_motion`.
    """
    motion, reading = read_motion_with(path, mapping, **options)
    body = body_of(motion.positions, motion.skeleton.roles, motion.fps)
    skeleton, heights = motion.skeleton, motion.positions[..., 1]
    names = skeleton.joints
    return {
        "file": str(path),
        "frames": motion.frames,
        "fps": motion.fps,
        "seconds": motion.duration,
        "joints": list(names),
        "parents": {names[j]: names[p] for j, p in enumerate(skeleton.parents) if p >= 0},
        "roles": {role: names[joint] for role, joint in skeleton.roles.items()},
        "rotations": motion.rotations is not None,
        **_decided(reading),
        "bones": dict(zip(names[1:], _lengths(motion), strict=True)),
        "stature": None if body is None else round(body.size * _STATURE, 2),
        "lowest": round(float(heights.min()), 3),
        "highest": round(float(heights.max()), 3),
        "notes": list(reading.notes),
    }, motion


def _decided(reading: Reading) -> dict[str, Any]:
    seen = {option: {name: round(odds, 1) for name, odds in of.items()} for option, of in reading.seen.items()}
    return {
        "up": reading.up,
        "unit": reading.unit,
        "mirrored": reading.mirrored,
        "skipped_first": reading.skipped_first,
        "roles_by": reading.roles,
        "told": list(reading.told),
        "probability": {option: round(share, 3) for option, share in reading.probability.items()},
        "evidence": seen,
    }


def _lengths(motion: Motion) -> list[float]:
    some = np.unique(np.linspace(0, motion.frames - 1, 200).astype(int))
    joints = motion.positions[some].astype(np.float64)
    bones = np.linalg.norm(joints[:, 1:] - joints[:, list(motion.skeleton.parents[1:])], axis=-1)
    return [round(float(length), 4) for length in np.median(bones, axis=0)]


def as_lines(told: Mapping[str, Any]) -> list[str]:
    """The same for people, a line for each thing decided."""
    bones, roles = told["bones"], told["roles"]
    stature = "unknown" if told["stature"] is None else f"{told['stature']:.2f} m by legs and trunk"
    limbs = ", ".join(f"{name} {bones[roles[end]]:.3f}" for end, name in _LIMBS.items() if roles.get(end) in bones)
    return [
        told["file"],
        f"  motion      {told['frames']} frames at {told['fps']:g} per second, {told['seconds']:.2f} s"
        f"{', with rotations' if told['rotations'] else ''}",
        f"  rig         {len(told['joints'])} joints, {len(roles)} roles by {told['roles_by']}",
        f"  up          {told['up']}{_how(told, 'up')}",
        f"  unit        {told['unit']:.4g} m{_how(told, 'unit')}",
        f"  left, right {'exchanged' if told['mirrored'] else 'as named'}{_how(told, 'mirror')}",
        f"  first frame {'left out, a calibration pose' if told['skipped_first'] else 'kept'}",
        f"  stature     {stature}",
        f"  heights     {told['lowest']:.2f} to {told['highest']:.2f} m",
        f"  left, m     {limbs or 'no limbs known'}",
        f"  roles       {', '.join(f'{role}={joint}' for role, joint in roles.items()) or 'none known'}",
        *(f"  note        {note}" for note in told["notes"]),
    ]


def _how(told: Mapping[str, Any], option: str) -> str:
    """What the user gave is "given"; else the probability, and the two next candidates with their log-odds."""
    if option in told["told"]:
        return " (given)"
    if option not in told["probability"]:
        return " (not measured)"
    odds = sorted(told["evidence"].get(option, {}).items(), key=lambda entry: -entry[1])[1:3]
    others = "; ".join(f"{name} {value:+.1f}" for name, value in odds)
    return f" ({told['probability'][option]:.0%}; evidence of others, log-odds: {others})"
