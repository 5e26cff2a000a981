"""Motion from one body to another: the source's bone directions, the target's bone lengths."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from motionary.motion.correspondence import COINCIDENT, correspondence, guessed, known_above, spine_bones
from motionary.motion.facing import fill_short
from motionary.motion.kinematics import agrees
from motionary.motion.motion import Motion
from motionary.motion.roles import names_by_role, read_mapping
from motionary.motion.rotations import TINY
from motionary.motion.skeleton import Skeleton
from motionary.motion.trunk import stands, trunk_bones

_SAME_BONE = 0.015  # metres; bodies whose bones differ by less, at one size, are one body (generators' bones vary so)
_SLOW, _LOW = 0.4, 0.03  # m/s and metres: a foot that stands moves less, and is lower


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
    its neutral one (`motionary.motion.trunk`); the spine bends as high as the source's, however many joints either has.
    Where the source is a body of the same shape, or the target's rest pose is not a person's, all bones keep their
    directions. All get the target's lengths. The way of the hips is scaled by the ratio of the leg lengths, feet that
    stand go on standing, and the lowest point of the motion keeps its height. Target joints that the source has not (or
    has on the spot of their parents) are placed in the shape that the target's rest pose has between their neighbors.
    Rotations are not carried over: `fit_rotations` finds them, and `Motion.to` those of a rig with its own rest pose.

    Args:
        motion: on any rig.
        skeleton: the target.
        mapping: the source's joint name by role, for rigs that are not known: see `name_joints`.

    Raises:
        InputError: a role that retargeting needs is missing on either side.
    """
    if mapping is not None:
        motion = name_joints(motion, mapping)
    source = correspondence(motion.skeleton, skeleton)
    points, known = guessed(motion, skeleton, source)
    same = _same_shape(motion, skeleton, points, known)
    reshaped = not same and stands(skeleton)
    ratio = _leg_ratio(points, skeleton)
    trunk = {} if same else spine_bones(motion, skeleton, points)
    if reshaped:
        trunk = trunk_bones(points, trunk, skeleton, motion.fps)
    positions = _placed(points, points[:, 0] * ratio, skeleton, trunk)
    if reshaped:
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
    short = np.square(bones).sum(-1).min(0) <= (COINCIDENT / 100) ** 2
    for joint in np.flatnonzero(short):
        default = skeleton.codec_directions[joint + 1].astype(np.float64)
        bones[:, joint] = fill_short(bones[:, joint], default, COINCIDENT / 100)
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
    above = [known_above(skeleton, known, j) for j in joints]
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
    return target / source if min(target, source) > COINCIDENT else 1.0
