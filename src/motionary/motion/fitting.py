"""Constant bones and true local rotations from joint positions alone, analytically."""

from __future__ import annotations

import numpy as np

from motionary.motion.facing import fill_short, heading
from motionary.motion.kinematics import agrees, local_turns, place
from motionary.motion.motion import Motion
from motionary.motion.rotations import (
    TINY,
    euler_to_rotmat,
    quat_continuation,
    rotmat_to_unitquat,
    special_procrustes,
    vectors_to_rotmat,
)
from motionary.motion.skeleton import Skeleton

_NO_BONE = 1e-4  # metres: a shorter bone tells nothing about rotation
_ROUNDS = 4  # of the fit of the shape at a joint with several children
_PULL = 1e-6  # weight of the expected rotation where children leave the rotation open (all in line)
_FOLDED = -0.98  # cosine: nearer to opposite, the least rotation has no certain axis; the frame before decides


def fit_rotations(motion: Motion) -> Motion:
    """The motion with constant bones (their median lengths) and local rotations that place its joints.

    Going down the tree, a joint with several children takes the rotation that brings their rest offsets nearest to
    them (Kabsch, SVD); a joint with one child turns its rest offset by the least rotation, starting from its parent's,
    so that no twist is added; a joint without children keeps its parent's. Bones aim at the joints' true places, so
    that errors do not add up. Where the angles between several children differ from the rest pose's, the rest offsets
    take the measured ones. On motion of a rigid-boned body the joints return within 1 mm. Rotations that a motion
    already has, and that place its joints within 1 mm, are kept.

    Returns:
        The motion with rotations, on a skeleton with the measured offsets; finite for any finite input.
    """
    if agrees(motion):
        return motion
    positions = motion.positions.astype(np.float64)
    offsets = _measured_offsets(positions, motion.skeleton)
    turned, placed = np.empty((*positions.shape, 3)), np.empty_like(positions)
    placed[:, 0] = positions[:, 0]
    expected = euler_to_rotmat(1, heading(motion))
    for joint, parent in enumerate(motion.skeleton.parents):
        if parent >= 0:
            placed[:, joint] = placed[:, parent] + (turned[:, parent] @ offsets[joint])
            expected = turned[:, parent]
        children = [c for c in _children(motion.skeleton, joint) if np.linalg.norm(offsets[c]) > _NO_BONE]
        if not children:
            turned[:, joint] = expected
        elif len(children) == 1:
            aim = fill_short(positions[:, children[0]] - placed[:, joint], offsets[children[0]], _NO_BONE)
            turned[:, joint] = _swing(expected, offsets[children[0]], aim)
        else:
            aims = positions[:, children] - placed[:, joint, None]
            offsets[children], turned[:, joint] = _fit_shape(offsets[children], aims, expected)
    skeleton = motion.skeleton.with_offsets(offsets)
    return _finished(motion, skeleton, turned)


def _finished(motion: Motion, skeleton: Skeleton, turned: np.ndarray) -> Motion:
    local = local_turns(skeleton, turned)
    rotations = quat_continuation(rotmat_to_unitquat(local))
    return Motion(place(skeleton, local, motion.positions[:, 0]), motion.fps, skeleton, rotations)


def _measured_offsets(positions: np.ndarray, skeleton: Skeleton) -> np.ndarray:
    """(J, 3) rest offsets in the skeleton's rest directions, of the bones' median lengths."""
    offsets = np.zeros((len(skeleton), 3))
    rest = skeleton.offsets.astype(np.float64)
    for joint, parent in enumerate(skeleton.parents[1:], 1):
        length = np.median(np.linalg.norm(positions[:, joint] - positions[:, parent], axis=-1))
        own = np.linalg.norm(rest[joint])
        direction = rest[joint] / own if own > TINY else skeleton.codec_directions[joint]
        offsets[joint] = direction * length
    return offsets


def _children(skeleton: Skeleton, joint: int) -> list[int]:
    return [c for c, parent in enumerate(skeleton.parents) if parent == joint]


def _fit_shape(offsets: np.ndarray, aims: np.ndarray, expected: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rest offsets (C, 3) of constant lengths and rotations (T, 3, 3) that bring them nearest to aims (T, C, 3)."""
    lengths = np.linalg.norm(offsets, axis=-1, keepdims=True)
    pull = _PULL * np.square(lengths).sum() * expected
    shape = offsets
    for _ in range(_ROUNDS):
        turned = special_procrustes(np.einsum("tci,cj->tij", aims, shape) + pull)
        mean = np.einsum("tij,tci->cj", turned, aims)
        size = np.linalg.norm(mean, axis=-1, keepdims=True)
        new = np.where(size > TINY, mean / np.maximum(size, TINY), shape / lengths) * lengths
        moved = np.abs(new - shape).max()
        shape = new
        if moved < 1e-7:
            break
    return shape, special_procrustes(np.einsum("tci,cj->tij", aims, shape) + pull)


def _swing(expected: np.ndarray, offset: np.ndarray, aim: np.ndarray) -> np.ndarray:
    """(T, 3, 3) rotations that turn `offset` (3,) along `aim` (T, 3), nearest to the expected ones (T, 3, 3).

    Where the bone points against its expected direction, the axis of the least rotation jumps about: those frames
    start from the frame before instead.
    """
    start = expected @ offset
    turned = vectors_to_rotmat(start, aim) @ expected
    cosine = (start * aim).sum(-1) / np.maximum(np.linalg.norm(start, axis=-1) * np.linalg.norm(aim, axis=-1), TINY)
    for frame in np.flatnonzero(cosine < _FOLDED):
        if frame:
            turned[frame] = vectors_to_rotmat(turned[frame - 1] @ offset, aim[frame]) @ turned[frame - 1]
    return turned
