"""Motion from one body to another: the source's bone directions, the target's bone lengths."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from motionary.errors import InputError
from motionary.motion.facing import fill_short
from motionary.motion.kinematics import agrees
from motionary.motion.motion import Motion
from motionary.motion.rigs import REQUIRED
from motionary.motion.roles import names_by_role, read_mapping
from motionary.motion.rotations import TINY, vectors_to_rotmat
from motionary.motion.skeleton import Skeleton
from motionary.motion.trunk import stands, trunk_bones

UNMAPPED = "roles of no known joint; say which joint plays which: mapping.json in a data folder, --mapping, mapping="
_SAME_BONE = 0.015  # metres; bodies whose bones differ by less, at one size, are one body (generators' bones vary so)
_SLOW, _LOW = 0.4, 0.03  # m/s and metres: a foot that stands moves less, and is lower
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

    Joints correspond by name where all names agree, otherwise by role (`Skeleton.roles`). Limbs and head keep the
    source's directions; hips, spine, collars and shoulders turn from the target's rest pose as the source's turn from
    its neutral one (`motionary.motion.trunk`). Where the source is a body of the same shape, or the target's rest pose
    is not a person's, all bones keep their directions. All get the target's lengths. The way of the hips is scaled by
    the ratio of the leg lengths, feet that stand go on standing, and the lowest point of the motion keeps its height.
    Target joints that the source has not (or has on the spot of their parents) are placed in the shape that the
    target's rest pose has between their neighbors. Rotations are not carried over: `fit_rotations` finds them, and
    `Motion.to` those of a rig with its own rest pose.

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
    points, known = _guess(motion, skeleton, source)
    same = _same_shape(motion, skeleton, points, known) or not stands(skeleton)
    ratio = _leg_ratio(points, skeleton)
    trunk = {} if same else trunk_bones(points, skeleton, motion.fps)
    positions = _placed(points, points[:, 0] * ratio, skeleton, trunk)
    if not same:
        # The legs hang from the hips, so that it is these which keep their way, and the root sits where it may.
        hips = list(skeleton.hips)
        positions += (points[:, hips].mean(1) * ratio - positions[:, hips].mean(1))[:, None]
        positions[..., [0, 2]] += _grip(points * ratio, positions, skeleton, motion.fps)[:, None]
    told = [j for j, s in enumerate(source) if s >= 0]
    floor = points[:, told, 1].min()
    positions[..., 1] += floor - positions[:, told, 1].min()
    return Motion(positions, motion.fps, skeleton)


def _placed(points: np.ndarray, root: np.ndarray, skeleton: Skeleton, trunk: Mapping[int, np.ndarray]) -> np.ndarray:
    """Joints (T, J, 3): from the root's places (T, 3) on, bones of the target's lengths along those of `trunk`, and
    along the source's where it has none.
    """
    parents = list(skeleton.parents[1:])
    bones = points[:, 1:] - points[:, parents]
    for joint, bone in trunk.items():
        bones[:, joint - 1] = bone
    short = np.square(bones).sum(-1).min(0) <= (_COINCIDENT / 100) ** 2
    for joint in np.flatnonzero(short):
        default = skeleton.codec_directions[joint + 1].astype(np.float64)
        bones[:, joint] = fill_short(bones[:, joint], default, _COINCIDENT / 100)
    bones /= np.maximum(np.linalg.norm(bones, axis=-1, keepdims=True), TINY)
    bones *= skeleton.bone_lengths[1:, None].astype(np.float64)
    positions = np.empty_like(points)
    positions[:, 0] = root
    for joint, parent in enumerate(parents, 1):
        positions[:, joint] = positions[:, parent] + bones[:, joint - 1]
    return positions


def _same_shape(motion: Motion, skeleton: Skeleton, points: np.ndarray, known: np.ndarray) -> bool:
    """Whether source and target are one body, perhaps of another size: then no part of it has to be reshaped.

    Either it says so by its skeleton, as what models of the target make does, whose bones are never quite as long; or
    all bones have the target's proportions; or the source's rotations stand on a rest pose whose bones have the
    target's directions.
    """
    if motion.skeleton.joints == skeleton.joints and np.array_equal(motion.skeleton.offsets, skeleton.offsets):
        return True
    joints = [j for j in range(1, len(skeleton)) if known[j]]
    above = [_known_above(skeleton, known, j) for j in joints]
    gap = np.median(np.linalg.norm(points[:, joints] - points[:, above], axis=-1), axis=0)
    own = np.linalg.norm(skeleton.rest[joints] - skeleton.rest[above], axis=-1)
    if gap.sum() > TINY and np.abs(gap * own.sum() / gap.sum() - own).max() < _SAME_BONE:
        return True
    if motion.skeleton.joints != skeleton.joints or motion.rotations is None:
        return False
    apart = np.abs(motion.skeleton.codec_directions - skeleton.codec_directions).max()
    across = np.linalg.norm(np.cross(motion.skeleton.offsets, skeleton.offsets), axis=-1)
    return bool(apart < 1e-4 and (across <= 1e-4 * skeleton.bone_lengths).all() and agrees(motion))


def _grip(points: np.ndarray, positions: np.ndarray, skeleton: Skeleton, fps: float) -> np.ndarray:
    """(T, 2) how far the body has to be moved along the ground for its standing feet to go as the source's do.

    Shins, thighs and feet of other proportions turn the same directions into other steps, by a few percent. A foot
    counts the more the slower and the lower it is in the source; between steps the body keeps the shift that it has.
    """
    feet = list(skeleton.feet)
    way, own = points[:, feet], positions[:, feet]
    step = np.diff(way[..., [0, 2]], axis=0)
    low = way[..., 1] - np.percentile(way[..., 1], 5, axis=0)
    speed = np.linalg.norm(step, axis=-1) * fps
    weight = np.exp(-np.square(speed / _SLOW) - np.square(np.maximum(low[1:], low[:-1]) / _LOW))
    missed = (weight[..., None] * (step - np.diff(own[..., [0, 2]], axis=0))).sum(1)
    shift = np.zeros((len(points), 2))
    shift[1:] = np.cumsum(missed / (weight.sum(1) + 1e-3)[:, None], axis=0)
    return shift


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


def _guess(motion: Motion, skeleton: Skeleton, source: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Points (T, J, 3) where the source has the target's joints; missing ones by the shape of the target's rest pose.

    Also (J,) bool, which are the source's own.
    """
    positions = motion.positions.astype(np.float64)
    points = positions[:, [max(s, 0) for s in source]]
    if motion.skeleton.joints == skeleton.joints:
        known = np.ones(len(skeleton), bool)
    else:
        known = np.array([s >= 0 for s in source])
    _forget_coincident(points, skeleton, known)
    if known.all():
        return points, known
    rest, torso = skeleton.rest, None
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
    return points, known


def _forget_coincident(points: np.ndarray, skeleton: Skeleton, known: np.ndarray) -> None:
    """Clears `known` (J,) of joints that lie on the known joint above, where the target has a bone."""
    bone = skeleton.bone_lengths > _COINCIDENT
    while True:
        above = [0] + [_known_above(skeleton, known, joint) for joint in range(1, len(skeleton))]
        gap = np.median(np.linalg.norm(points - points[:, above], axis=-1), axis=0)
        on_top = known & bone & (gap < _COINCIDENT)
        on_top &= ~on_top[above]  # what hangs from one of these is measured again, from the joint above it
        if not on_top.any():
            return
        known &= ~on_top


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


def _known_above(skeleton: Skeleton, known: np.ndarray, joint: int) -> int:
    """The nearest known joint above, or the root."""
    parent = skeleton.parents[joint]
    while parent > 0 and not known[parent]:
        parent = skeleton.parents[parent]
    return parent


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
