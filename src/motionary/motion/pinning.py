"""Motion bent to go through given poses: the least smooth correction, which fades between them."""

from __future__ import annotations

import numpy as np

from motionary.motion.facing import heading, rotate_y
from motionary.motion.fitting import fit_rotations
from motionary.motion.kinematics import forward_kinematics
from motionary.motion.motion import Motion
from motionary.motion.rotations import (
    quat_conjugation,
    quat_continuation,
    quat_product,
    rotvec_to_unitquat,
    unitquat_slerp,
    unitquat_to_rotvec,
)
from motionary.motion.skeleton import Skeleton
from motionary.motion.smoothing import smoothest

_FADES = 0.25  # seconds in which the correction of a pose fades
_TURNS = 0.35  # and that of where the body faces
_FIRM = 1e6  # weight of a given pose against the stiffness of the correction


def posed(skeleton: Skeleton, rotations: np.ndarray, roots: np.ndarray, fps: float) -> Motion:
    """The motion of local rotations (T, J, 4) xyzw and root positions (T, 3)."""
    rotations = quat_continuation(np.asarray(rotations, np.float64))
    return Motion(forward_kinematics(skeleton, rotations, roots), fps, skeleton, rotations)


def on_body(motion: Motion, skeleton: Skeleton | None = None) -> Motion:
    """The motion with rotations, on bones of one length: its own, or those of a skeleton of the same joints."""
    fitted = fit_rotations(motion)
    if skeleton is None or fitted.skeleton == skeleton:
        return fitted
    return posed(skeleton, turns(fitted), fitted.positions[:, 0], fitted.fps)


def turns(motion: Motion) -> np.ndarray:
    """(T, J, 4) float64 rotations of a motion that has them."""
    assert motion.rotations is not None
    return motion.rotations.astype(np.float64)


def bent(motion: Motion, yaw: np.ndarray, shift: np.ndarray) -> Motion:
    """The motion whose way is turned step by step by yaw (T,) radians, and then moved by (T, 3) metres.

    Every frame keeps its pose; the first frame's root is what the way turns about.
    """
    rotations, roots = turns(motion), motion.positions[:, 0].astype(np.float64)
    steps = rotate_y(np.diff(roots, axis=0), (yaw[1:] + yaw[:-1]) / 2)
    way = np.concatenate([roots[:1], roots[:1] + np.cumsum(steps, axis=0)]) + shift
    about = np.stack([0 * yaw, np.sin(yaw / 2), 0 * yaw, np.cos(yaw / 2)], axis=-1)
    rotations[:, 0] = quat_product(about, rotations[:, 0])
    return posed(motion.skeleton, rotations, way, motion.fps)


def placed_at(motion: Motion, frame: int, root: np.ndarray, facing: float) -> Motion:
    """The motion moved and turned as a whole so that a frame has its root over (3,) and faces `facing` radians."""
    yaw = facing - float(heading(motion)[frame])
    turned = bent(motion, np.full(motion.frames, yaw), np.zeros(3))
    shift = (np.asarray(root, np.float64) - turned.positions[frame, 0]) * np.array([1, 0, 1])
    return bent(turned, np.zeros(motion.frames), shift)


def pinned(motion: Motion, frames: list[int], poses: Motion) -> Motion:
    """The motion that has given poses at some frames.

    Rotations and the height take up the difference over a quarter of a second around each; the way over the ground
    takes it up along the smoothest curve between them, stays as far off after the last, and starts where it started.

    Args:
        motion: with rotations.
        frames: K of its frames, in order.
        poses: K frames on the same skeleton, with rotations.
    """
    mine, theirs = turns(motion), turns(poses)
    moved = theirs.copy()
    for k, frame in enumerate(frames):
        moved[k] = quat_product(theirs[k], quat_conjugation(mine[frame]))
    asked = np.zeros((motion.frames, len(motion.skeleton), 3))
    asked[frames] = unitquat_to_rotvec(moved)
    off = np.zeros((motion.frames, 3))
    off[frames] = poses.positions[:, 0].astype(np.float64) - motion.positions[frames, 0]
    limbs = _faded(asked[:, 1:].reshape(motion.frames, -1), frames, _FADES * motion.fps)
    correction = np.concatenate([_faded(asked[:, 0], frames, _TURNS * motion.fps), limbs], axis=1)
    way = _led(off[:, [0, 2]], frames)
    height = _faded(off[:, 1:2], frames, _FADES * motion.fps)
    shift = np.stack([way[:, 0], height[:, 0], way[:, 1]], axis=-1)
    rotations = quat_product(rotvec_to_unitquat(correction.reshape(asked.shape)), mine)
    return posed(motion.skeleton, rotations, motion.positions[:, 0] + shift, motion.fps)


def touching(motion: Motion, frames: list[int], positions: np.ndarray) -> Motion:
    """The motion whose joints are at positions (K, J, 3) at K frames, without rotations.

    The correction fades over a quarter of a second around each frame. Where the positions are another body's (other
    bone lengths, wider hips or shoulders), bones stretch by the difference meanwhile.
    """
    left = np.zeros((motion.frames, motion.positions[0].size))
    left[frames] = (positions.astype(np.float64) - motion.positions[frames]).reshape(len(frames), -1)
    left = _faded(left, frames, _FADES * motion.fps).reshape(motion.positions.shape)
    return Motion(motion.positions + left, motion.fps, motion.skeleton)


def _faded(values: np.ndarray, frames: list[int], reach: float) -> np.ndarray:
    """(T, K) corrections that are given at some frames and fade to zero within `reach` frames of each."""
    stiffness, weights = reach**4, np.ones(len(values))
    weights[frames] = _FIRM * max(stiffness, 1)
    return smoothest(values, weights, stiffness)


def _led(values: np.ndarray, frames: list[int]) -> np.ndarray:
    """(T, K) the smoothest curve through values given at some frames, constant before the first and after the last."""
    weights = np.full(len(values), 1e-9)
    weights[frames] = 1e3
    values = values.copy()
    if len(values) - 1 not in frames:
        values[-1], weights[-1] = values[frames[-1]], 1e3
    if 0 not in frames:
        weights[0] = 1e3
    return smoothest(values, weights, 1.0)


def extrapolated(motion: Motion, before: int, after: int) -> Motion:
    """The motion with frames before and after it, in which it goes on as in its first and its last step."""
    rotations, roots = turns(motion), motion.positions[:, 0].astype(np.float64)
    if motion.frames == 1:
        rotations, roots = np.repeat(rotations, 2, axis=0), np.repeat(roots, 2, axis=0)
    back, on = -np.arange(before, 0, -1.0), np.arange(1.0, after + 1)
    first = unitquat_slerp(np.repeat(rotations[:1], before, 0), np.repeat(rotations[1:2], before, 0), back)
    last = unitquat_slerp(np.repeat(rotations[-2:-1], after, 0), np.repeat(rotations[-1:], after, 0), 1 + on)
    start = roots[0] + back[:, None] * (roots[1] - roots[0])
    end = roots[-1] + on[:, None] * (roots[-1] - roots[-2])
    middle = slice(0, motion.frames)
    whole = np.concatenate([first, rotations[middle], last])
    return posed(motion.skeleton, whole, np.concatenate([start, roots[middle], end]), motion.fps)
