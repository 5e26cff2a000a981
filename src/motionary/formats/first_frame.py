"""A calibration pose put before the motion, as in cgspeed's files: told by its shape and by the jump out of it. One
frame of it is left out; several are only told, since times that people note beside a file count them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from motionary.formats.animated_rig import stretches

_SIDES = ("left", "right")
_BONES = (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))
_UNTURNED = 0.99999  # cosine of half an angle of half a degree
_ALIGNED = np.cos(np.radians(25))
_TWINS = np.cos(np.radians(2))
_JUMP, _TIMES = 0.05, 5  # metres on average, and how many times later steps
DOUBT = (
    "the first frame may be a calibration pose: it was kept "
    "(say otherwise with --skip-first; in Python skip_first=True)"
)
_HELD = 1e-3  # metres: no joint moves farther while a pose is held


def held_calibration(roles: Mapping[str, int], positions: np.ndarray) -> int:
    """How many frames a T-pose is held at the start, to the millimetre, before the joints jump out of it by 5 cm
    or more on average; 0 where it is one frame, which `is_calibration` judges, or none. Arguments as there."""
    if not len(positions) or not _in_t_pose(roles, positions[0]):
        return 0
    moved = (t for t in range(1, len(positions)) if np.abs(positions[t] - positions[0]).max() > _HELD)
    held = next(moved, 0)
    return held if held > 1 and _steps(positions[held - 1 : held + 1])[0] > _JUMP else 0


def held_line(held: int, fps: float) -> str:
    """The line that tells of so many frames."""
    start = f"the motion seems to begin at {held / fps:.2f} s: --start; in Python motion.crop({held}, motion.frames)"
    return f"the first {held} frames hold a calibration pose and were kept ({start})"


def is_calibration(roles: Mapping[str, int], positions: np.ndarray, rotations: np.ndarray) -> bool | None:
    """Whether the first frame is no part of the motion; None where it may be.

    It is a T-pose (both upper arms and forearms lie within 25 degrees of the line through the shoulders and both legs
    within 25 degrees of the vertical), or the rig's own rest pose, whatever that is (no joint below the root is turned,
    and the second frame has some), out of which the joints jump, relative to the root: 5 cm or more on average to the
    second frame. It is left out where that is at least five times as far as between later frames (95th percentile), a
    T-pose also where nobody would stand so exactly and the second frame does not: it is the rest pose, or the left
    limbs are the right ones' mirror image within 2 degrees.

    Args:
        roles: joint by role.
        positions: (T, J, 3) metres, y up.
        rotations: (T, J, 4) local.
    """
    if len(positions) < 3:
        return False
    resting = [bool((np.abs(turns) > _UNTURNED).all()) for turns in rotations[:2, 1:, 3]]
    t_pose = _in_t_pose(roles, positions[0])
    if not (t_pose or (resting[0] and not resting[1])):
        return False
    steps = np.concatenate(
        [_steps(positions[max(some.start - 1, 0) : some.stop]) for some in stretches(len(positions))]
    )
    if steps[0] <= _JUMP:
        return False
    far = steps[0] > _TIMES * np.percentile(steps[1:], 95)
    if far or not t_pose:
        return True if far else None
    even = [_is_t_pose(limbs) and _symmetric(limbs) for limbs in (_limbs(roles, positions[i]) for i in (0, 1))]
    exact = (resting[0] and not resting[1]) or (even[0] and not even[1])
    return True if exact else None


def _in_t_pose(roles: Mapping[str, int], points: np.ndarray) -> bool:
    """Whether points (J, 3) are a T-pose; False where the limbs' roles are not known."""
    names = {f"{side}_{part}" for part in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle") for side in _SIDES}
    return names <= roles.keys() and _is_t_pose(_limbs(roles, points))


def _limbs(roles: Mapping[str, int], points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3,) the unit vector from the right shoulder to the left one, and (2, 4, 3) the sides' `_BONES`, of length 1."""
    at = {role: points[joint].astype(np.float64) for role, joint in roles.items()}
    across = at["left_shoulder"] - at["right_shoulder"]
    bones = np.array([[at[f"{side}_{end}"] - at[f"{side}_{begin}"] for begin, end in _BONES] for side in _SIDES])
    lengths = np.linalg.norm(bones, axis=-1, keepdims=True)
    return across / max(np.linalg.norm(across), 1e-9), bones / np.maximum(lengths, 1e-9)


def _is_t_pose(limbs: tuple[np.ndarray, np.ndarray]) -> bool:
    across, bones = limbs
    arms = bones[:, :2] @ across * np.array([[1], [-1]])
    legs = -bones[:, 2:, 1]
    return bool(min(arms.min(), legs.min()) > _ALIGNED)


def _symmetric(limbs: tuple[np.ndarray, np.ndarray]) -> bool:
    """Whether the left limbs are the right ones', mirrored at right angles to the shoulders."""
    across, (left, right) = limbs
    mirrored = right - 2 * (right @ across)[:, None] * across
    return bool((left * mirrored).sum(-1).min() > _TWINS)


def _steps(positions: np.ndarray) -> np.ndarray:
    """(T-1,) how far the joints move on average from each frame to the next, relative to the root."""
    local = positions.astype(np.float64) - positions[:, :1]
    return np.linalg.norm(np.diff(local, axis=0), axis=-1).mean(-1)
