"""The trunk from one rig to another: its parts' turns are carried over, its shape is the target's own.

Limbs mean the same on every rig: hip to knee to ankle and shoulder to elbow to wrist lie along the same bones of a
person, and two solves of one take agree on their directions within one to two degrees. The trunk does not. Where
"pelvis", "spine2" or "collar" sit inside a body is each rig's own choice, so that its hips, collars and spine bones
differ from another's by constant angles of up to 40 degrees. Files seldom say which: the zero pose of OFFSETs is a
T-pose on some rigs, but bones along one axis or parts turned against each other on others, and arrays have none. So
the source's neutral shape is calibrated from the motion, equally for files and arrays: the mean direction of each part
in the frame of the trunk, over the frames in which it is upright. The turn from that mean at each frame is what the
target's part turns from its rest pose.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np

from motionary.motion.facing import fill_short
from motionary.motion.rigs import SPINE
from motionary.motion.rotations import TINY, vectors_to_rotmat
from motionary.motion.skeleton import Skeleton

Frames: TypeAlias = np.ndarray
"""(T, 3, 3) rotation matrices, their columns the axes left, up and ahead."""

_PRIOR = 0.25  # seconds of the target's rest pose that count with the motion's own frames
_UPRIGHT = (0.7, 0.9)  # cosines of the trunk to the vertical: from none to all of a frame's weight
_LEAST = 0.1  # weight of a frame that is not upright, for motions that never are


@dataclass(frozen=True)
class _Parts:
    """The frames of trunk, pelvis and chest at some joints."""

    trunk: Frames
    pelvis: Frames
    chest: Frames


def trunk_bones(
    points: np.ndarray, spine: Mapping[int, np.ndarray], skeleton: Skeleton, fps: float
) -> dict[int, np.ndarray]:
    """Bone directions of the target's trunk, (T, 3) by joint: hips, spine, neck, collars and shoulders.

    Args:
        points: (T, J, 3) the source's joints at the places of the target's.
        spine: the source's bones (T, 3) of the target's spine and neck, by joint.
        skeleton: the target.
        fps: of the motion.
    """
    rest = skeleton.rest
    seen, own = _parts(points, skeleton), _own_parts(skeleton)
    weights = _weights(seen.trunk[..., 1, 1])
    prior = _PRIOR * fps
    pelvis = _carried(seen.trunk, seen.pelvis, own.trunk, own.pelvis, weights, prior)
    chest = _carried(seen.trunk, seen.chest, own.trunk, own.chest, weights, prior)
    roles = skeleton.roles
    bones: dict[int, np.ndarray] = {}
    for joint in skeleton.hips:
        bones[joint] = pelvis @ _offset(rest, skeleton, joint)
    for role in ("left_collar", "right_collar"):
        if role in roles:
            bones[roles[role]] = chest @ _offset(rest, skeleton, roles[role])
    if spine:
        own_bones = np.array([_offset(rest, skeleton, joint) for joint in spine]) @ own.trunk[0]
        turned = _turned(seen.trunk, np.stack(list(spine.values()), axis=1), own_bones, weights, prior)
        bones |= {joint: turned[:, k] for k, joint in enumerate(spine)}
    moved = _shoulder_moves(points, skeleton, seen, own, weights)
    for joint, move in zip(skeleton.shoulders, moved, strict=True):
        bones[joint] = (chest @ (_offset(rest, skeleton, joint) + move)[..., None])[..., 0]
    return bones


def trunk_frames(points: np.ndarray, skeleton: Skeleton) -> Frames:
    """Axes of the trunk: across by hips and shoulders, up from the pelvis to the middle of the shoulders.

    The pelvis is the middle between root and hips: rigs differ in where they put the root, some in the hips' line and
    some 10 cm above and behind it, and this middle is where two solves of one take agree best (within a degree).
    """
    (a, b), (c, d) = skeleton.hips, skeleton.shoulders
    side = points[:, a] - points[:, b] + points[:, c] - points[:, d]
    base = (2 * points[:, 0] + points[:, a] + points[:, b]) / 4
    return _axes(side, (points[:, c] + points[:, d]) / 2 - base, None)


@lru_cache
def stands(skeleton: Skeleton) -> bool:
    """Whether the rest pose is that of a person who stands: only then does it say how a trunk is built.

    Many files have zero poses with all bones along one axis, or with parts turned against each other.
    """
    rest, (a, b), (c, d) = skeleton.rest, skeleton.hips, skeleton.shoulders
    hips, shoulders, feet = rest[a] - rest[b], rest[c] - rest[d], rest[list(skeleton.feet[::2])].mean(0)
    up, leg = (rest[c] + rest[d] - rest[a] - rest[b]) / 2, (rest[a] + rest[b]) / 2 - feet

    def along(v: np.ndarray, w: np.ndarray) -> bool:
        """Whether two vectors point alike, within 37 degrees."""
        return bool(v @ w > 0.8 * np.linalg.norm(v) * np.linalg.norm(w))

    level = abs(up @ hips) < 0.3 * np.linalg.norm(up) * np.linalg.norm(hips)
    return along(hips, shoulders) and along(up, leg) and bool(level)


@lru_cache
def _own_parts(skeleton: Skeleton) -> _Parts:
    return _parts(skeleton.rest[None], skeleton)


def _parts(points: np.ndarray, skeleton: Skeleton) -> _Parts:
    (a, b), (c, d) = skeleton.hips, skeleton.shoulders
    trunk = trunk_frames(points, skeleton)
    spine = [skeleton.roles[role] for role in SPINE if role in skeleton.roles]
    low = next((j for j in spine if np.median(np.linalg.norm(points[:, j] - points[:, 0], axis=-1)) > 0.01), c)
    pelvis = _axes(points[:, a] - points[:, b], points[:, low] - (points[:, a] + points[:, b]) / 2, trunk)
    top = spine[-1] if spine else c
    base = skeleton.parents[top] if len(spine) > 1 else 0
    chest = _axes(points[:, c] - points[:, d], points[:, top] - points[:, base], trunk)
    return _Parts(trunk, pelvis, chest)


def _axes(side: np.ndarray, up: np.ndarray, otherwise: Frames | None) -> Frames:
    """Frames whose left is `side` (T, 3), and whose up lies in the plane of `side` and `up`."""
    default = np.eye(3) if otherwise is None else otherwise[0]
    side = fill_short(side, default[:, 0])
    side = side / np.maximum(np.linalg.norm(side, axis=-1, keepdims=True), TINY)
    ahead = fill_short(_cross(side, up), default[:, 2], 1e-4)
    ahead = ahead - (ahead * side).sum(-1, keepdims=True) * side
    ahead = ahead / np.maximum(np.linalg.norm(ahead, axis=-1, keepdims=True), TINY)
    return np.stack([side, _cross(ahead, side), ahead], axis=-1)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of (T, 3); numpy's own takes several times as long on a few hundred rows."""
    return a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]


def _weights(upright: np.ndarray) -> np.ndarray:
    """(T,) how much each frame says about the neutral shape, by the cosine of its trunk to the vertical."""
    low, high = _UPRIGHT
    return _LEAST + np.clip((upright - low) / (high - low), 0, 1)


def _mean(values: np.ndarray, rest: np.ndarray, weights: np.ndarray, prior: float) -> np.ndarray:
    """The weighted mean over time of values (T, ...), with `prior` frames of `rest` (...) among them."""
    return (np.tensordot(weights, values, 1) + prior * rest) / (weights.sum() + prior)


def _carried(
    trunk: Frames, part: Frames, rest_trunk: Frames, rest_part: Frames, weights: np.ndarray, prior: float
) -> Frames:
    """Turns of a part of the trunk from the target's rest pose: by as much as the source's part from its neutral."""
    local = trunk.swapaxes(-1, -2) @ part
    own = (rest_trunk.swapaxes(-1, -2) @ rest_part)[0]
    neutral = _mean(local, own, weights, prior)
    neutral = _axes(neutral[None, :, 0], neutral[None, :, 1], None)[0]
    return part @ (neutral.T @ own) @ rest_part[0].T


def _turned(trunk: Frames, bones: np.ndarray, own: np.ndarray, weights: np.ndarray, prior: float) -> np.ndarray:
    """Directions of bones (T, B, 3), turned in the trunk's frame by what brings their means to the rest's `own` (B, 3).

    Bones without length stay without.
    """
    local = bones @ trunk
    local /= np.maximum(np.linalg.norm(local, axis=-1, keepdims=True), TINY)
    own = own / np.maximum(np.linalg.norm(own, axis=-1, keepdims=True), TINY)
    turns = vectors_to_rotmat(_mean(local, own, weights, prior), own)
    return np.einsum("tij,bjk,tbk->tbi", trunk, turns, local, optimize=["einsum_path", (1, 2), (0, 1)])


def _shoulder_moves(
    points: np.ndarray, skeleton: Skeleton, seen: _Parts, own: _Parts, weights: np.ndarray
) -> list[np.ndarray]:
    """(T, 3) of both shoulders, how far they are from their neutral places on the chest, in the target's rest pose.

    Shrugs and reaches move shoulders by collars of any length and place: what rigs share is where the shoulder goes,
    in units of the shoulders' width.
    """
    left, right = skeleton.shoulders
    base = skeleton.parents[skeleton.roles["neck"]] if "neck" in skeleton.roles else 0
    width = np.median(np.linalg.norm(points[:, left] - points[:, right], axis=-1))
    size = np.linalg.norm(skeleton.rest[left] - skeleton.rest[right]) / width if width > TINY else 0.0
    moves = []
    for joint in (left, right):
        place = np.einsum("tji,tj->ti", seen.chest, points[:, joint] - points[:, base])
        neutral = np.tensordot(weights, place, 1) / weights.sum()
        moves.append((place - neutral) * size @ own.chest[0].T)
    return moves


def _offset(rest: np.ndarray, skeleton: Skeleton, joint: int) -> np.ndarray:
    return rest[joint] - rest[skeleton.parents[joint]]
