"""Two-bone inverse kinematics of legs, and feet that keep to a path."""

from __future__ import annotations

import numpy as np

from motionary.motion.rotations import TINY, orthogonal, vectors_to_rotmat

_REACH = (
    0.9995  # of the leg's length: a goal beyond it is approached as far as this, so that knees do not snap straight
)
_SLOW, _LOW = 0.4, 0.04  # m/s and metres: a foot that stands moves less, and is lower
_NEAR = 0.1  # metres: a foot that swings higher keeps the height of the pose
_IDLE = 0.02  # weight of a foot in the air, against 1 of one that stands


def two_bone(hip: np.ndarray, knee: np.ndarray, ankle: np.ndarray, goal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """World rotations (T, 3, 3) of thigh and shin that bring the ankle to its goal, the knee bending as it did.

    The knee opens or closes in the plane in which it is bent (by the law of cosines), and the whole leg swings by the
    least rotation. Goals out of reach are approached along the line to them.

    Args:
        hip, knee, ankle, goal: (T, 3).
    """
    upper, lower = np.linalg.norm(knee - hip, axis=-1), np.linalg.norm(ankle - knee, axis=-1)
    reach = np.linalg.norm(goal - hip, axis=-1)
    line = ankle - hip
    longest = np.maximum((upper + lower) * _REACH, np.linalg.norm(line, axis=-1))
    reach = np.clip(reach, np.abs(upper - lower) + TINY, longest)
    line = line / np.maximum(np.linalg.norm(line, axis=-1, keepdims=True), TINY)
    out = knee - hip
    out = out - (out * line).sum(-1, keepdims=True) * line
    length = np.linalg.norm(out, axis=-1, keepdims=True)
    out = np.where(length > 1e-6, out / np.maximum(length, TINY), orthogonal(line))
    along = (np.square(upper) - np.square(lower) + np.square(reach)) / np.maximum(2 * reach, TINY)
    bent = np.sqrt(np.maximum(np.square(upper) - np.square(along), 0))
    new_knee = along[:, None] * line + bent[:, None] * out
    swing = vectors_to_rotmat(line, goal - hip)
    thigh = swing @ vectors_to_rotmat(knee - hip, new_knee)
    shin = swing @ vectors_to_rotmat(ankle - knee, reach[:, None] * line - new_knee)
    return thigh, shin


def held_feet(paths: list[np.ndarray], own: list[np.ndarray], fps: float) -> tuple[list[np.ndarray], np.ndarray]:
    """How far each foot, and before them the root, have to move so that feet stand where they should, (T, 3) each.

    The body moves with the foot that stands, which costs the pose nothing; what is left, where both stand, is for the
    legs. In the air the pose keeps what it has, but near the ground it keeps to the path's height: a foot that comes
    lower than it did drags. Heights are measured from where each foot is when it stands (the 5th percentile), since
    joints of another rig lie higher or lower in the foot.

    Args:
        paths: (T, 3) where the left and the right foot's joint should go.
        own: (T, 3) where they are.
        fps: frames per second.

    Returns:
        The moves of the feet, once the root has moved, and that of the root.
    """
    held = [standing(path, fps) for path in paths]
    # One lift for both: where one foot stands higher than the other, that is the pose's fault and not the rig's.
    lift = min(np.percentile(o[:, 1], 5) - np.percentile(path[:, 1], 5) for path, o in zip(paths, own, strict=True))
    missed = [path + np.array([0, lift, 0]) - o for path, o in zip(paths, own, strict=True)]
    weights = np.stack(held) + _IDLE
    body = (weights[..., None] * np.stack(missed)).sum(0) / weights.sum(0)[:, None]
    moves = []
    for path, hold, miss in zip(paths, held, missed, strict=True):
        above = np.maximum(path[:, 1] - np.percentile(path[:, 1], 5), 0)
        low = np.maximum(hold, np.exp(-np.square(above / _NEAR)))
        moves.append(np.stack([hold, low, hold], axis=-1) * (miss - body))
    return moves, body


def standing(joint: np.ndarray, fps: float) -> np.ndarray:
    """(T,) from 0 to 1, how surely a foot joint (T, 3) stands: it is slow, and near the lowest it gets."""
    height = joint[:, 1] - np.percentile(joint[:, 1], 5)
    speed = np.zeros(len(joint))
    if len(joint) > 1:
        steps = np.linalg.norm(np.diff(joint[:, [0, 2]], axis=0), axis=-1) * fps
        speed[1:], speed[0] = steps, steps[0]
        speed[:-1] = np.minimum(speed[:-1], steps)
    slow = np.exp(-np.square(speed / _SLOW) - np.square(np.maximum(height, 0) / _LOW))
    return np.minimum(1.3 * slow, 1)  # surely standing is held to the millimetre
