"""Which joint of one rig corresponds to which of another, and a guess at where joints lie that the source lacks."""

from __future__ import annotations

import numpy as np

from motionary.errors import InputError
from motionary.motion.facing import fill_short
from motionary.motion.motion import Motion
from motionary.motion.rigs import REQUIRED, SPINE
from motionary.motion.rotations import TINY, vectors_to_rotmat
from motionary.motion.skeleton import Skeleton
from motionary.motion.tree import common_ancestor

UNMAPPED = "roles of no known joint; say which joint plays which: mapping.json in a data folder, --mapping, mapping="
COINCIDENT = 1e-3  # metres: nearer than this, a source joint says nothing about its bone


def correspondence(source: Skeleton, target: Skeleton) -> list[int]:
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


def guessed(motion: Motion, skeleton: Skeleton, source: list[int]) -> tuple[np.ndarray, np.ndarray]:
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


def spine_bones(motion: Motion, skeleton: Skeleton, points: np.ndarray) -> dict[int, np.ndarray]:
    """Bones (T, 3) of the target's spine and neck, by joint, in the source's directions and lengths.

    Rigs cut the line from pelvis to neck into one to eight bones: a spine2 is not as high on one as on another, and
    joints that bend need not play any role. So the source's whole line is cut where the target's joints are, by share
    of its length. Where either rig's line is not known, the bones are those between roles.

    Args:
        motion: the source.
        skeleton: the target.
        points: (T, J, 3) the source's joints at the places of the target's.
    """
    source, target = _spine_line(motion.skeleton), _spine_line(skeleton)
    chain = [skeleton.parents[joint] for joint in target[1:]] == target[:-1]
    if not (source and target and chain):
        played = [skeleton.roles[role] for role in SPINE if role in skeleton.roles]
        return {joint: points[:, joint] - points[:, skeleton.parents[joint]] for joint in played}
    line = motion.positions[:, source].astype(np.float64)
    lengths = np.median(np.linalg.norm(np.diff(line, axis=1), axis=-1), axis=0)
    heights = np.cumsum([0, *lengths])
    shares = np.cumsum([0, *skeleton.bone_lengths[target[1:]].astype(np.float64)])
    cuts = heights[-1] * shares / max(shares[-1], TINY)
    below = np.clip(np.searchsorted(heights, cuts, "right") - 1, 0, len(lengths) - 1)
    part = ((cuts - heights[below]) / np.maximum(lengths[below], TINY))[:, None]
    places = line[:, below] * (1 - part) + line[:, below + 1] * part
    return dict(zip(target[1:], np.diff(places, axis=1).swapaxes(0, 1), strict=True))


def _spine_line(skeleton: Skeleton) -> list[int]:
    """The joints from the pelvis to the neck, whatever roles they play; none where the neck is not known.

    What pelvis and spine both hang on may lie anywhere: it is left out.
    """
    if not {"pelvis", "neck"} <= skeleton.roles.keys():
        return []
    pelvis, joint = skeleton.roles["pelvis"], skeleton.roles["neck"]
    meet, line = common_ancestor(skeleton.parents, pelvis, joint), []
    while joint != meet:
        line.append(joint)
        joint = skeleton.parents[joint]
    return [pelvis, *reversed(line)]


def known_above(skeleton: Skeleton, known: np.ndarray, joint: int) -> int:
    """The nearest known joint above, or the root."""
    parent = skeleton.parents[joint]
    while parent > 0 and not known[parent]:
        parent = skeleton.parents[parent]
    return parent


def _forget_coincident(points: np.ndarray, skeleton: Skeleton, known: np.ndarray) -> None:
    """Clears `known` (J,) of joints that lie on the known joint above, where the target has a bone."""
    bone = skeleton.bone_lengths > COINCIDENT
    while True:
        above = [0] + [known_above(skeleton, known, joint) for joint in range(1, len(skeleton))]
        gap = np.median(np.linalg.norm(points - points[:, above], axis=-1), axis=0)
        on_top = known & bone & (gap < COINCIDENT)
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


def _nearest_known(skeleton: Skeleton, known: np.ndarray, joint: int) -> int:
    """The known joint fewest bones below, -1 if there is none."""
    level = [joint]
    while level:
        level = [j for j, parent in enumerate(skeleton.parents) if parent in level]
        if found := [j for j in level if known[j]]:
            return found[0]
    return -1
