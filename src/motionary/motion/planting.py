"""Feet that stand where they stand: `Motion.plant_feet`.

Three steps, each of which leaves alone what is right. The body goes along with feet that slide for long (a root that
was predicted too fast or too slow). The legs take what is left, by two-bone inverse kinematics to one place for each
stance. Between stances the correction fades along the smoothest curve, so nothing pops. Nothing is filtered: frames
in the air keep their pose.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from motionary.errors import InputWarning
from motionary.motion.fitting import fit_rotations
from motionary.motion.kinematics import global_turns, local_turns, place
from motionary.motion.limbs import Leg, legs_of
from motionary.motion.motion import Motion
from motionary.motion.rotations import quat_continuation, rotmat_to_unitquat, unitquat_to_rotmat
from motionary.motion.smoothing import smoothest
from motionary.motion.stances import grip, heights, runs, stance_weights

_LEGS = 0.85  # metres from hip to ankle of the body that all metres here and in `stances` are for
# The root follows feet that slide for long: seconds over which its correction changes, and the m/s up to which it is
# left alone, since real feet roll and turn as fast.
_DRIFTS = ((0.5, 0.15), (2.0, 0.03))
_FAST = (1.5, 0.7, 0.3, 0.15)  # m/s of a foot that the body goes with, round by round: the less it slides, the surer
_IDLE = 0.02  # weight of a root that keeps its way, against 1 of a foot that stands
_SURE, _LOOSE = 1e4, 0.05  # weights of a foot that stands, or flies, and of one that is about to
_KEPT = 1e8  # weight of a foot that must not move
_LIFTED = 0.025  # metres at which a foot in the air has the weight 1; it grows with the fourth power of the height
_FLIGHT = 0.05  # metres: where all joints of both feet are higher, the body flies and keeps its pose
_BLEND = 0.15  # seconds in which a foot comes to its place or leaves it
_FEWEST = 3  # frames


def plant_feet(motion: Motion, first_frame: int = 0) -> Motion:
    """See `Motion.plant_feet`."""
    kept = np.arange(motion.frames) < first_frame
    if motion.frames - first_frame < _FEWEST:
        return motion
    planted = replant_feet(motion, kept, first_frame)
    if planted is motion or motion.rotations is not None:
        return planted
    return replace(motion, positions=np.where(kept[:, None, None], motion.positions, planted.positions))


def replant_feet(motion: Motion, kept: np.ndarray, follow_from: int | None = None) -> Motion:
    """The motion with feet that stand still, but for frames whose feet stay as they are.

    Args:
        motion: on any rig; one without known legs is returned as it is, with one line of warning.
        kept: (T,) bool, frames whose feet do not move; a stance that holds one stands where it is then.
        follow_from: the frame from which the body goes along with feet that slide for long; None: it keeps its way.
    """
    legs = legs_of(motion.skeleton)
    if legs is None:
        rule = "feet stay as they are; a mapping would tell the rig's hips, knees and ankles"
        warnings.warn(InputWarning(f"{motion.skeleton.name}: unknown legs: {rule}"), stacklevel=4)
        return motion
    rigid = fit_rotations(motion)
    points, lengths = rigid.positions.astype(np.float64), rigid.skeleton.bone_lengths
    scale = sum(float(lengths[joint]) for leg in legs for joint in leg.bones) / (2 * _LEGS)
    if scale <= 0:
        return motion
    feet = [joint for leg in legs for joint in leg.feet]
    if follow_from is not None:
        points[follow_from:] += root_shift(points[follow_from:, feet], motion.fps, scale)[:, None]
    flies = np.all(heights(points[:, feet]) > _FLIGHT * scale, axis=1)
    moves = [foot_moves(points[:, leg.feet], flies, kept, motion.fps, scale) for leg in legs]
    planted = _posed(rigid, points, legs, moves)
    # What came without rotations goes without: its skeleton's bones need not be as long as the motion's.
    return planted if motion.rotations is not None else replace(motion, positions=planted.positions)


def root_shift(feet: np.ndarray, fps: float, scale: float = 1.0) -> np.ndarray:
    """(T, 3) metres along the ground that the body has to go for joints of its feet (T, N, 3) to stand still.

    Slides of a stance that real feet have too (a few cm/s) move nothing, so that real motion keeps its way.
    """
    shift = np.zeros((len(feet), 3))
    for seconds, least in _DRIFTS:
        shift += _drift(feet + shift[:, None], fps, scale, seconds, least)
    return shift


def _drift(feet: np.ndarray, fps: float, scale: float, seconds: float, least: float) -> np.ndarray:
    """One step of `root_shift`: by weighted least squares on the velocity, reweighted by what still slides."""
    shift, steps = np.zeros((len(feet), 3)), np.diff(feet, axis=0) * np.array([1, 0, 1])
    for fast in _FAST:
        holds = grip(feet + shift[:, None], fps, scale, fast)
        holds = np.minimum(holds[1:], holds[:-1])
        total = holds.sum(1) + _IDLE
        calm = smoothest(-(holds[..., None] * steps).sum(1) / total[:, None], total, (seconds * fps / 2) ** 4)
        speed = np.linalg.norm(calm, axis=-1, keepdims=True) * fps / scale
        shift[1:] = np.cumsum(calm * np.maximum(1 - np.square(least / np.maximum(speed, least)), 0), axis=0)
    return shift


def foot_moves(foot: np.ndarray, flies: np.ndarray, kept: np.ndarray, fps: float, scale: float = 1.0) -> np.ndarray:
    """(T, N, 3) metres that the joints of one foot (T, N, 3), ankle and toe, have to move for it to stand still.

    Args:
        foot: (T, N, 3).
        flies: (T,) where the body is in the air, and nothing moves.
        kept: (T,) where nothing moves either; a stance that holds such a frame stands where it is then.
        fps: frames per second.
        scale: of the body, 1 for legs of 0.85 m.
    """
    sure, high = stance_weights(foot, fps, scale), np.maximum(heights(foot), 0) / (_LIFTED * scale)
    moves = np.zeros_like(foot)
    for n in range(foot.shape[1]):
        wanted, stands = np.zeros_like(foot[:, n]), sure[:, n] > 0
        for first, last in runs(stands):
            path, stays = foot[first:last, n], np.flatnonzero(kept[first:last])
            stand = np.median(path[sure[first:last, n] == 1], axis=0)
            if len(stays):
                stand = path[stays[np.abs(np.arange(last - first)[:, None] - stays).argmin(1)]]
            wanted[first:last] = (stand - path) * np.array([1, 0, 1])
        weights = np.where(stands, _LOOSE * (_SURE / _LOOSE) ** sure[:, n], np.minimum(_LOOSE + high[:, n] ** 4, _SURE))
        weights[flies], weights[kept] = _SURE, _KEPT
        wanted[flies | kept] = 0
        moves[:, n] = smoothest(wanted, weights, (_BLEND * fps / 2) ** 4)
    return moves


def _posed(rigid: Motion, points: np.ndarray, legs: Sequence[Leg], moves: Sequence[np.ndarray]) -> Motion:
    """The motion with its root where `points` (T, J, 3) have it, and with moved feet (T, N, 3 each)."""
    assert rigid.rotations is not None
    turned = global_turns(rigid.skeleton, unitquat_to_rotmat(rigid.rotations))
    for leg, move in zip(legs, moves, strict=True):
        leg.reach(turned, points, points[:, leg.feet] + move)
    local = local_turns(rigid.skeleton, turned)
    rotations = quat_continuation(rotmat_to_unitquat(local))
    return Motion(place(rigid.skeleton, local, points[:, 0]), rigid.fps, rigid.skeleton, rotations)
