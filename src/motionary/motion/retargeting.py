"""Motion from one body to another: the source's bone directions, the target's bone lengths."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from motionary.errors import InputError
from motionary.motion.facing import fill_short
from motionary.motion.motion import Motion
from motionary.motion.rigs import REQUIRED
from motionary.motion.roles import names_by_role, read_mapping
from motionary.motion.rotations import TINY, vectors_to_rotmat
from motionary.motion.skeleton import Skeleton

UNMAPPED = "roles of no known joint; say which joint plays which: mapping.json in a data folder, --mapping, mapping="
_COINCIDENT = 1e-3  # metres: nearer than this, a source joint says nothing about its bone


def name_joints(motion: Motion, mapping: Path | str | Mapping[str, str]) -> Motion:
    """The motion with joints called by their roles, so that a rig that is not known is read like one that is.

    Args:
        motion: on any rig.
        mapping: the joint's name by role (a dict or a JSON file), of the roles that its own name does not tell. Roles
            are the SMPL joint names: pelvis, left_hip, left_knee, ...

    Raises:
        InputError: the mapping is unreadable, or a role or joint is unknown.
    """
    skeleton = motion.skeleton
    given = read_mapping(mapping, skeleton.joints)
    names = names_by_role(skeleton.joints, skeleton.roles, given)
    return replace(motion, skeleton=Skeleton.from_rig(skeleton.name, names, skeleton.parents, skeleton.offsets))


def retarget(motion: Motion, skeleton: Skeleton, mapping: Path | str | Mapping[str, str] | None = None) -> Motion:
    """The motion on another skeleton.

    Joints correspond by name where all names agree, otherwise by role (`Skeleton.roles`). Bones keep the source's
    directions and get the target's lengths; the root's way is scaled by the ratio of the leg lengths, and the lowest
    point of the motion keeps its height. Target joints that the source has not (or has on the spot of their parents)
    are placed in the shape that the target's rest pose has between their neighbors. Rotations are not carried over:
    `fit_rotations` finds them.

    Args:
        motion: on any rig.
        skeleton: the target.
        mapping: the source's joint name by role, for rigs that are not known: see `name_joints`.

    Raises:
        InputError: a role that retargeting needs is missing on either side.
    """
    if mapping is not None:
        motion = name_joints(motion, mapping)
    source = _correspondence(motion.skeleton, skeleton)
    points = _guess(motion, skeleton, source)
    lengths = skeleton.bone_lengths.astype(np.float64)
    rest = skeleton.codec_directions.astype(np.float64)
    positions = np.empty_like(points)
    positions[:, 0] = points[:, 0] * _leg_ratio(points, skeleton)
    for joint, parent in enumerate(skeleton.parents[1:], 1):
        bone = fill_short(points[:, joint] - points[:, parent], rest[joint], _COINCIDENT / 100)
        bone = bone / np.maximum(np.linalg.norm(bone, axis=-1, keepdims=True), TINY)
        positions[:, joint] = positions[:, parent] + lengths[joint] * bone
    known = [j for j, s in enumerate(source) if s >= 0]
    floor = points[:, known, 1].min()
    positions[..., 1] += floor - positions[:, known, 1].min()
    return Motion(positions, motion.fps, skeleton)


def _correspondence(source: Skeleton, target: Skeleton) -> list[int]:
    """The source joint of every target joint, -1 where there is none."""
    if source.joints == target.joints:
        return list(range(len(target)))
    given = source.roles
    for skeleton in (source, target):
        if missing := [role for role in REQUIRED if role not in skeleton.roles]:
            raise InputError(f"skeleton {skeleton.name}", ", ".join(missing), UNMAPPED)
    result = [-1] * len(target)
    for role, joint in target.roles.items():
        result[joint] = given.get(role, -1)
    if result[0] < 0:
        result[0] = given["pelvis"]
    return result


def _guess(motion: Motion, skeleton: Skeleton, source: list[int]) -> np.ndarray:
    """(T, J, 3) where the source has the target's joints; missing ones by the shape of the target's rest pose."""
    positions = motion.positions.astype(np.float64)
    points = positions[:, [max(s, 0) for s in source]]
    if motion.skeleton.joints == skeleton.joints:
        known = np.ones(len(skeleton), bool)
    else:
        known = np.array([s >= 0 for s in source])
    for joint, parent in enumerate(skeleton.parents[1:], 1):
        while parent > 0 and not known[parent]:
            parent = skeleton.parents[parent]
        gap = np.linalg.norm(points[:, joint] - points[:, parent], axis=-1)
        if known[joint] and skeleton.bone_lengths[joint] > _COINCIDENT and np.median(gap) < _COINCIDENT:
            known[joint] = False
    rest = np.zeros((len(skeleton), 3))
    for joint, parent in enumerate(skeleton.parents[1:], 1):
        rest[joint] = rest[parent] + skeleton.offsets[joint]
    torso = None
    for joint, parent in enumerate(skeleton.parents[1:], 1):
        if known[joint]:
            continue
        if torso is None:
            torso = _torso(points, rest, skeleton)
        below = _nearest_known(skeleton, known, joint)
        begin, end = (parent, below) if below >= 0 else (skeleton.parents[parent], parent)
        bone, seen = rest[end] - rest[max(begin, 0)], points[:, end] - points[:, max(begin, 0)]
        turn = vectors_to_rotmat(torso @ bone, seen) @ torso
        # Between two known joints the shape is stretched to fit; beyond the last one it keeps its own scale.
        size = (
            np.linalg.norm(seen, axis=-1) / np.linalg.norm(bone) if below >= 0 and np.linalg.norm(bone) > TINY else 1.0
        )
        points[:, joint] = points[:, parent] + np.multiply(
            turn @ (rest[joint] - rest[parent]), np.reshape(size, (-1, 1))
        )
    return points


def _torso(points: np.ndarray, rest: np.ndarray, skeleton: Skeleton) -> np.ndarray:
    """(T, 3, 3) rotation of the trunk from the rest pose: across by hips and shoulders, up from hips to shoulders."""

    def frame(p: np.ndarray) -> np.ndarray:
        """(T, 3, 3) axes of the trunk at joint positions (T, J, 3)."""
        (a, b), (c, d) = skeleton.hips, skeleton.shoulders
        side = fill_short(p[:, a] - p[:, b] + p[:, c] - p[:, d], np.array([1.0, 0, 0]))
        up = (p[:, c] + p[:, d]) - (p[:, a] + p[:, b])
        side = side / np.linalg.norm(side, axis=-1, keepdims=True)
        ahead = fill_short(np.cross(side, up), np.array([0, 0, 1.0]))
        ahead = ahead / np.linalg.norm(ahead, axis=-1, keepdims=True)
        up = np.cross(ahead, side)
        up = up / np.maximum(np.linalg.norm(up, axis=-1, keepdims=True), TINY)
        return np.stack([np.cross(up, ahead), up, ahead], axis=-1)

    return frame(points) @ frame(rest[None]).swapaxes(-1, -2)


def _nearest_known(skeleton: Skeleton, known: np.ndarray, joint: int) -> int:
    """The known joint fewest bones below, -1 if there is none."""
    level = [joint]
    while level:
        level = [j for j, parent in enumerate(skeleton.parents) if parent in level]
        if found := [j for j in level if known[j]]:
            return found[0]
    return -1


def _leg_ratio(points: np.ndarray, skeleton: Skeleton) -> float:
    """Length of the target's legs (hip to ankle) by the source's; 1 where either has none."""
    target = source = 0.0
    for hip, foot in zip(skeleton.hips, skeleton.feet[::2], strict=True):
        joint = foot
        while joint not in (hip, 0):
            parent = skeleton.parents[joint]
            target += float(skeleton.bone_lengths[joint])
            source += float(np.median(np.linalg.norm(points[:, joint] - points[:, parent], axis=-1)))
            joint = parent
    return target / source if min(target, source) > _COINCIDENT else 1.0
