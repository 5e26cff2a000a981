"""Whether a motion looks possible: planted feet, smooth joints, feet on the floor, bones that keep their length.

Read each beside the figure of real motions: people jump, slide and stop short, and captured bones give a little.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from motionary.errors import InputError

if TYPE_CHECKING:
    from motionary.motion import Motion


def foot_skating(motion: Motion, height: float = 0.015, contacts: Any = None) -> float:
    """Mean speed over the ground of the foot joints while in contact (thesis 5.4), in m/s; 0 without any contact.

    Args:
        motion: at least 2 frames.
        height: a foot is planted while its toe is within `height` metres, and its ankle within twice that, of the level
            each has when it stands (the 5th percentile of its heights, so that no floor need be known). Contacts found
            by speed would hide the very skating that is measured.
        contacts: (T-1, 4) labels to use instead, of left ankle, left toe, right ankle, right toe.
    """
    feet = np.asarray(motion.positions, np.float64)[:, list(motion.skeleton.feet)]  # (T, 4, 3)
    if len(feet) < 2:
        raise InputError("motion", f"{len(feet)} frames", "foot skating needs at least 2 frames")
    speed = np.linalg.norm(np.diff(feet[..., [0, 2]], axis=0), axis=-1) * motion.fps
    if contacts is None:
        above = feet[..., 1] - np.percentile(feet[..., 1], 5, axis=0)
        low = above < height * np.array([2, 1, 2, 1])
        planted = (low[:, 0::2] & low[:, 1::2]).repeat(2, axis=1)
        contacts = planted[1:] & planted[:-1]
    contacts = np.asarray(contacts) > 0.5
    if contacts.shape != speed.shape:
        raise InputError("contacts", contacts.shape, f"must have the shape {speed.shape}")
    return float(speed[contacts].mean()) if contacts.any() else 0.0


def jitter(motion: Motion) -> float:
    """Mean jerk of the joints: the norm of the third derivative of positions over frames and joints, in m/s^3."""
    p = np.asarray(motion.positions, np.float64)
    if len(p) < 4:
        raise InputError("motion", f"{len(p)} frames", "a third derivative needs at least 4 frames")
    return float(np.linalg.norm(np.diff(p, n=3, axis=0), axis=-1).mean() * motion.fps**3)


def penetration(motion: Motion, floor: float = 0.0) -> float:
    """Mean depth over frames of the lowest joint below the floor, in metres."""
    return float(np.clip(floor - _lowest(motion), 0, None).mean())


def floating(motion: Motion, floor: float = 0.0, height: float = 0.05) -> float:
    """Share of frames in which no joint comes within `height` metres of the floor.

    Running and jumping leave the floor too, so read it beside the figure of real motions.
    """
    return float((_lowest(motion) > floor + height).mean())


def bone_change(motion: Motion) -> float:
    """Mean distance over frames and bones of a bone's length from its mean over the motion, in metres; 0 for rigid
    bones."""
    p, parents = np.asarray(motion.positions, np.float64), motion.skeleton.parents
    joints = [joint for joint, parent in enumerate(parents) if parent >= 0]
    if not joints:
        raise InputError("motion", f"{len(parents)} joints", "a change of bones needs at least one bone")
    length = np.linalg.norm(p[:, joints] - p[:, [parents[joint] for joint in joints]], axis=-1)  # (T, J - 1)
    return float(np.abs(length - length.mean(axis=0)).mean())


# Every measure, in the order of tables.
MEASURES: dict[str, Callable[[Motion], float]] = {
    "foot_skating": foot_skating,
    "penetration": penetration,
    "floating": floating,
    "jitter": jitter,
    "bone_change": bone_change,
}


def physics(motion: Motion) -> dict[str, float]:
    """All measures of a motion of at least 4 frames: foot_skating (m/s), penetration (m), floating (share of frames),
    jitter (the joints' jerk, m/s^3) and bone_change (m)."""
    return {name: measure(motion) for name, measure in MEASURES.items()}


def _lowest(motion: Motion) -> np.ndarray:
    return np.asarray(motion.positions, np.float64)[..., 1].min(axis=1)
