"""A motion on a character's own rig: `Motion.to`. Rotations are carried over, with their twist, in a common T-pose.

Every rig is brought to one pose on paper: the limbs along those of smpl22's T-pose, the trunk upright, the feet as they
stand. What a joint turns from there is the same on all rigs, whatever its rest pose, axes and proportions:

    G_target(t) = G_source(t) K_source^-1 K_target,    K = global rotation of the joint in the common pose.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from motionary.errors import InputError
from motionary.motion.correspondence import UNMAPPED
from motionary.motion.feet import held_feet, two_bone
from motionary.motion.fitting import fit_rotations
from motionary.motion.kinematics import agrees, global_turns, local_turns, place
from motionary.motion.motion import Motion
from motionary.motion.retargeting import retarget
from motionary.motion.roles import REQUIRED
from motionary.motion.rotations import (
    euler_to_rotmat,
    quat_continuation,
    rotmat_to_unitquat,
    special_procrustes,
    unitquat_to_rotmat,
    vectors_to_rotmat,
)
from motionary.motion.skeleton import Skeleton
from motionary.motion.trunk import stands, trunk_frames

_SIDES = ("left", "right")
_TRUNK = ("pelvis", "spine1", "spine2", "spine3", "neck", "head")
_LIMBS = (("hip", "knee", None), ("knee", "ankle", "hip"), ("shoulder", "elbow", None), ("elbow", "wrist", "shoulder"))


@dataclass(frozen=True)
class Rig:
    """A character's skeleton and one pose in which it stands as a person does.

    Attributes:
        skeleton: joints and their offsets, metres.
        pose: (J, 3, 3) local rotations of that pose: T, A, or any upright one.
    """

    skeleton: Skeleton
    pose: np.ndarray

    @staticmethod
    def of(skeleton: Skeleton, rotations: np.ndarray | None = None) -> Rig:
        """The rig whose rest pose stands, or else the most upright of some frames.

        Args:
            skeleton: with the roles that retargeting needs.
            rotations: (T, J, 4) local quaternions of a motion on it, for rest poses that are no person's.

        Raises:
            InputError: a role is missing, or no pose is known in which the rig stands.
        """
        if stands(skeleton) or any(role not in skeleton.roles for role in REQUIRED):
            return Rig.posed(skeleton, np.tile(np.eye(3), (len(skeleton), 1, 1)))
        if rotations is None:
            rule = "its rest pose is not a person's; give the motion or file that it comes from, not the skeleton alone"
            raise InputError("rig", skeleton.name, rule)
        return Rig(skeleton, _standing_pose(skeleton, unitquat_to_rotmat(rotations)))

    @staticmethod
    def posed(skeleton: Skeleton, pose: np.ndarray) -> Rig:
        """The rig in a pose (J, 3, 3) that is known to stand. InputError: a role is missing."""
        if missing := [role for role in REQUIRED if role not in skeleton.roles]:
            raise InputError(f"skeleton {skeleton.name}", ", ".join(missing), UNMAPPED)
        return Rig(skeleton, pose)


@dataclass(frozen=True)
class _Common:
    """A rig in the common pose: global rotations K (3, 3) by role, and the length of its legs, metres."""

    turns: dict[str, np.ndarray]
    legs: float


def to_rig(motion: Motion, rig: Rig, source: Rig | None = None) -> Motion:
    """The motion on a rig: its joints, their order and rest pose; see `Motion.to`.

    Joints without a role (fingers, helpers) stay as they are in the rig's own pose. The hips' way is scaled by the
    ratio of the leg lengths; where feet stand, first the body and then, by two-bone IK, the legs give way to them.

    Args:
        motion: on any rig with the roles that retargeting needs.
        rig: the target.
        source: the rig that the motion is on; by default its rest pose, or else its own most upright frame.
    """
    recorded = motion
    if not agrees(motion):
        motion, source = fit_rotations(retarget(motion, Skeleton.named("smpl22"))), None
    assert motion.rotations is not None
    source = source or Rig.of(motion.skeleton, motion.rotations)
    ours, theirs = _common(source), _common(rig)
    # Hips and feet go the way that was recorded: a body in between would slide where this one stands.
    ratio = theirs.legs / (ours.legs if recorded is motion else _legs(recorded.positions, recorded.skeleton.roles))
    turned = global_turns(motion.skeleton, unitquat_to_rotmat(motion.rotations))
    carried = _carried(turned, motion.skeleton, ours, rig, theirs)
    seen = {role: recorded.positions[:, j].astype(np.float64) for role, j in recorded.skeleton.roles.items()}
    local = local_turns(rig.skeleton, carried)
    placed = _placed(rig.skeleton, local, seen, ratio)
    roles = rig.skeleton.roles
    legs = [(roles[f"{side}_hip"], roles[f"{side}_knee"], roles[f"{side}_ankle"]) for side in _SIDES]
    # A foot turns about its ball when the heel leaves the ground: what stands is the toe, where both rigs have one.
    sole = "foot" if all(f"{s}_foot" in r for r in (seen, roles) for s in _SIDES) else "ankle"
    soles = [roles[f"{side}_{sole}"] for side in _SIDES]
    paths = [seen[f"{side}_{sole}"] * ratio for side in _SIDES]
    moves, body = held_feet(paths, [placed[:, joint] for joint in soles], motion.fps)
    placed += body[:, None]
    for leg, move in zip(legs, moves, strict=True):
        thigh, shin = two_bone(placed[:, leg[0]], placed[:, leg[1]], placed[:, leg[2]], placed[:, leg[2]] + move)
        _turn_leg(rig, carried, leg, thigh, shin)
    local = local_turns(rig.skeleton, carried)
    placed = place(rig.skeleton, local, placed[:, 0])
    return Motion(placed, motion.fps, rig.skeleton, quat_continuation(rotmat_to_unitquat(local)))


def _standing_pose(skeleton: Skeleton, local: np.ndarray) -> np.ndarray:
    """(J, 3, 3) the most upright of the poses (T, J, 3, 3), each foot turned as it is when it stands.

    People who walk never have both feet flat at once. A foot stands where it is the lower of the two, and most of
    these frames have it flat: the one of median pitch is taken.
    """
    points, turned = place(skeleton, local, np.zeros((len(local), 3))), global_turns(skeleton, local)
    best = int(np.argmax(_uprightness(points, skeleton)))
    pose, (a, b) = local[best].copy(), skeleton.hips
    heading = np.arctan2(points[:, b, 2] - points[:, a, 2], points[:, a, 0] - points[:, b, 0])
    ankles, toes = list(skeleton.feet[::2]), list(skeleton.feet[1::2])
    height = (points[:, ankles, 1] + points[:, toes, 1]) / 2
    for side, (ankle, toe) in enumerate(zip(ankles, toes, strict=True)):
        lower = np.flatnonzero(height[:, side] <= height[:, 1 - side] + 0.005)
        lower = lower if len(lower) else np.array([best])
        pitch = points[lower, toe, 1] - points[lower, ankle, 1]
        frame = int(lower[np.argsort(pitch)[len(pitch) // 2]])
        yaw = euler_to_rotmat(1, heading[best] - heading[frame])
        pose[ankle] = turned[best, skeleton.parents[ankle]].T @ yaw @ turned[frame, ankle]
    return pose


def _uprightness(points: np.ndarray, skeleton: Skeleton) -> np.ndarray:
    """(T,) how well each pose (T, J, 3) shows standing: legs straight below an upright trunk, arms down."""
    roles = skeleton.roles

    def along(begin: str, end: str) -> np.ndarray:
        """(T, 3) unit vectors from one joint to another."""
        bone = points[:, roles[end]] - points[:, roles[begin]]
        return bone / np.maximum(np.linalg.norm(bone, axis=-1, keepdims=True), 1e-9)

    legs = sum(-along(f"{s}_hip", f"{s}_knee")[:, 1] - along(f"{s}_knee", f"{s}_ankle")[:, 1] for s in _SIDES)
    arms = sum(-along(f"{s}_shoulder", f"{s}_elbow")[:, 1] - along(f"{s}_elbow", f"{s}_wrist")[:, 1] for s in _SIDES)
    return legs + 2 * trunk_frames(points, skeleton)[:, 1, 1] + arms / 2


def _common(rig: Rig) -> _Common:
    """The rig brought from its own pose to the common one."""
    skeleton, model = rig.skeleton, Skeleton.named("smpl22")
    points = place(skeleton, rig.pose, np.zeros(3))
    turned = global_turns(skeleton, rig.pose[None])[0]
    roles = skeleton.roles
    frame = trunk_frames(points[None], skeleton)[0]
    trunk = trunk_frames(model.rest[None], model)[0] @ frame.T
    level = euler_to_rotmat(1, -np.arctan2(frame[0, 2], frame[2, 2]))
    moved = dict.fromkeys(roles, trunk)
    for side in _SIDES:
        for begin, end, above in _LIMBS:
            base = trunk if above is None else moved[f"{side}_{above}"]
            bone = points[roles[f"{side}_{end}"]] - points[roles[f"{side}_{begin}"]]
            wanted = model.rest[model.roles[f"{side}_{end}"]] - model.rest[model.roles[f"{side}_{begin}"]]
            moved[f"{side}_{begin}"] = vectors_to_rotmat((base @ bone)[None], wanted[None])[0] @ base
        moved[f"{side}_wrist"] = moved[f"{side}_elbow"]
        moved[f"{side}_ankle"] = moved[f"{side}_foot"] = level
    return _Common({role: moved[role] @ turned[j] for role, j in roles.items()}, _legs(points[None], roles))


def _legs(points: np.ndarray, roles: Mapping[str, int]) -> float:
    """Median length of both legs, hip to ankle, at joint positions (T, J, 3), metres."""
    bones = [(roles[f"{s}_{a}"], roles[f"{s}_{b}"]) for s in _SIDES for a, b in (("hip", "knee"), ("knee", "ankle"))]
    return sum(float(np.median(np.linalg.norm(points[:, a] - points[:, b], axis=-1))) for a, b in bones)


def _carried(turned: np.ndarray, skeleton: Skeleton, ours: _Common, rig: Rig, theirs: _Common) -> np.ndarray:
    """Global rotations (T, J, 3, 3) of the target's joints from those of the source's (T, S, 3, 3)."""
    known = {role: turned[:, skeleton.roles[role]] @ turn.T for role, turn in ours.turns.items()}
    result = np.empty((len(turned), len(rig.skeleton), 3, 3))
    names = {joint: role for role, joint in rig.skeleton.roles.items()}
    for joint, parent in enumerate(rig.skeleton.parents):
        if (role := names.get(joint)) is not None:
            result[:, joint] = _turn_of(role, known) @ theirs.turns[role]
        else:
            result[:, joint] = rig.pose[joint] if parent < 0 else result[:, parent] @ rig.pose[joint]
    return result


def _turn_of(role: str, known: Mapping[str, np.ndarray]) -> np.ndarray:
    """(T, 3, 3) turns of a role; where the source lacks it, half-way between those of its neighbours in the trunk."""
    if role in known:
        return known[role]
    part = role.split("_")[-1]
    if part == "foot":
        return known[role.replace("foot", "ankle")]
    at = _TRUNK.index("neck" if part == "collar" else part)
    below = next(known[name] for name in reversed(_TRUNK[:at]) if name in known)
    if part in ("collar", "head"):
        return below
    above = next((known[name] for name in _TRUNK[at:] if name in known), below)
    return special_procrustes(below + above)


def _role_above(skeleton: Skeleton, joint: int, among: Iterable[int]) -> int | None:
    joint = skeleton.parents[joint]
    while joint >= 0 and joint not in among:
        joint = skeleton.parents[joint]
    return joint if joint >= 0 else None


def _turn_leg(rig: Rig, turned: np.ndarray, leg: tuple[int, int, int], thigh: np.ndarray, shin: np.ndarray) -> None:
    """Turns thigh and shin with what hangs on them (twist bones); the foot keeps its rotation in the world."""
    hip, knee, ankle = leg
    for joint in range(hip, len(rig.skeleton)):
        above = _role_above(rig.skeleton, joint, (hip, knee, ankle)) if joint not in leg else joint
        if above in (hip, knee):
            turned[:, joint] = (thigh if above == hip else shin) @ turned[:, joint]


def _placed(skeleton: Skeleton, local: np.ndarray, seen: dict[str, np.ndarray], ratio: float) -> np.ndarray:
    """Joints (T, J, 3) whose hips go the source's way at the target's size, on the same ground."""
    placed = place(skeleton, local, np.zeros((len(local), 3)))
    hips, feet = list(skeleton.hips), list(skeleton.feet)
    placed += ((seen["left_hip"] + seen["right_hip"]) * (ratio / 2) - placed[:, hips].mean(1))[:, None]
    soles = [values for role, values in seen.items() if role.endswith(("ankle", "foot"))]
    ground = np.percentile(np.min([values[:, 1] for values in soles], axis=0), 5)
    placed[..., 1] += ground - np.percentile(placed[:, feet, 1].min(1), 5)
    return placed
