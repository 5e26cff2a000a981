"""From control curves to joints: forward kinematics of trunk and arms, analytic two-bone IK of the legs.

The rig takes every length from the skeleton, so bones are constant by construction. A leg's two bones are solved in
the plane that holds hip, ankle and the knee's forward direction: the law of cosines gives the knee.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from motionary.corpus.demo.curves import dilate, rotate_x, rotate_y, rotate_z, smooth
from motionary.corpus.demo.plan import Plan
from motionary.motion import Motion, Skeleton
from motionary.motion.rotations import quat_continuation, rotmat_to_unitquat, unitvectors_to_rotmat

DOWN = np.array([0.0, -1.0, 0.0])
SIGNS = (1.0, -1.0)  # left lies at +x
REACH = 0.9985  # a leg is never stretched beyond this share of its length


@dataclass(frozen=True, eq=False)
class DemoRig:
    """Joint indices and lengths of a skeleton, as the solver needs them (sides: left, right)."""

    skeleton: Skeleton
    offsets: np.ndarray  # (J, 3) float64
    thigh: np.ndarray  # (2,) m
    shin: np.ndarray  # (2,) m
    standing: float  # pelvis height above the floor with straight legs and flat feet, m

    def joint(self, side: int, part: str) -> int:
        """Index of a joint by side (0 left, 1 right) and part ("knee")."""
        return self.skeleton.roles[f"{('left', 'right')[side]}_{part}"]


@lru_cache(maxsize=4)
def rig_of(skeleton: Skeleton) -> DemoRig:
    """The rig of a skeleton whose joints carry the SMPL roles."""
    offsets = skeleton.offsets.astype(np.float64)
    roles = skeleton.roles
    lengths = np.linalg.norm(offsets, axis=-1)
    sides = ("left", "right")
    thigh = np.array([lengths[roles[f"{s}_knee"]] for s in sides])
    shin = np.array([lengths[roles[f"{s}_ankle"]] for s in sides])
    drop = np.array([-offsets[roles[f"{s}_hip"]][1] - offsets[roles[f"{s}_foot"]][1] for s in sides])
    return DemoRig(skeleton, offsets, thigh, shin, float((thigh + shin + drop).min()))


def _pelvis(plan: Plan) -> np.ndarray:
    pitch, lean, twist = np.moveaxis(plan.pelvis, -1, 0)
    return rotate_y(plan.yaw + twist) @ rotate_x(pitch) @ rotate_z(-lean)


def _root(rig: DemoRig, plan: Plan) -> np.ndarray:
    """(N, 3) pelvis positions."""
    sine, cosine = np.sin(plan.yaw), np.cos(plan.yaw)
    left, forward = plan.sway[:, 0], plan.sway[:, 1]
    x = plan.path[:, 0] + cosine * left + sine * forward
    z = plan.path[:, 1] - sine * left + cosine * forward
    return np.stack([x, rig.standing + plan.height, z], axis=-1)


def _planted_ankle(rig: DemoRig, plan: Plan, side: int) -> np.ndarray:
    foot = rotate_y(plan.foot_yaw[:, side]) @ rotate_x(plan.foot_pitch[:, side])
    return plan.ball[:, side] - foot @ rig.offsets[rig.joint(side, "foot")]


def _free_leg(rig: DemoRig, plan: Plan, side: int) -> np.ndarray:
    """(N, 3) hip to ankle of a leg whose joints are given by angles."""
    _, flexion, abduction, knee = np.moveaxis(plan.legs[:, side], -1, 0)
    thigh = rotate_y(plan.yaw) @ rotate_z(SIGNS[side] * abduction) @ rotate_x(-flexion)
    shin = thigh @ rotate_x(knee)
    return rig.thigh[side] * (thigh @ DOWN) + rig.shin[side] * (shin @ DOWN)


def within_reach(rig: DemoRig, plan: Plan) -> Plan:
    """The plan with the pelvis lowered, smoothly and in good time, wherever a planted leg would be too short."""
    root, pelvis = _root(rig, plan), _pelvis(plan)
    deficit = np.zeros(plan.frames)
    for side in (0, 1):
        hip = root + pelvis @ rig.offsets[rig.joint(side, "hip")]
        ankle = _planted_ankle(rig, plan, side)
        reach = REACH * (rig.thigh[side] + rig.shin[side])
        level = np.sum((hip - ankle)[:, [0, 2]] ** 2, axis=-1)
        highest = ankle[:, 1] + np.sqrt(np.maximum(reach**2 - level, 0.01))
        over = (hip[:, 1] - highest) * (1 - plan.legs[:, side, 0])
        deficit = np.maximum(deficit, over)
    # Widening by as much as the averages blur keeps the lowered pelvis at or below every limit.
    return replace(plan, height=plan.height - smooth(dilate(deficit, 0.2), 0.1))


def _leg(rig: DemoRig, plan: Plan, side: int, hip: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """World rotations (N, 3, 3) of hip, knee and ankle joints."""
    weight, flexion, abduction, knee = np.moveaxis(plan.legs[:, side], -1, 0)
    w = weight[:, None]
    yaw = (1 - weight) * plan.foot_yaw[:, side] + weight * plan.yaw
    pitch = (1 - weight) * plan.foot_pitch[:, side] + weight * (knee - flexion + 0.35)
    foot = rotate_y(yaw) @ rotate_z(SIGNS[side] * weight * abduction) @ rotate_x(pitch)
    ankle = (1 - w) * _planted_ankle(rig, plan, side) + w * (hip + _free_leg(rig, plan, side))
    # A free foot passes over the floor, however low the pelvis: a smooth maximum of its ball's height and zero.
    ball = ankle[:, 1] + (foot @ rig.offsets[rig.joint(side, "foot")])[:, 1]
    ankle[:, 1] += 0.5 * (np.sqrt(ball**2 + (0.03 * weight) ** 2) - ball) * (weight > 0)
    thigh, shin = rig.thigh[side], rig.shin[side]
    reach = ankle - hip
    length = np.linalg.norm(reach, axis=-1)
    distance = np.clip(length, abs(thigh - shin) + 0.05, 0.9999 * (thigh + shin))
    # The knee points where pelvis and foot point on average.
    facing = rotate_y(plan.yaw + 0.5 * plan.pelvis[:, 2] + 0.5 * (1 - weight) * (plan.foot_yaw[:, side] - plan.yaw))
    direction = np.einsum("nji,nj->ni", facing, reach / length[:, None])
    axis = facing @ unitvectors_to_rotmat(np.broadcast_to(DOWN, direction.shape), direction)
    at_hip = np.arccos(np.clip((thigh**2 + distance**2 - shin**2) / (2 * thigh * distance), -1, 1))
    inner = np.arccos(np.clip((thigh**2 + shin**2 - distance**2) / (2 * thigh * shin), -1, 1))
    upper = axis @ rotate_x(-at_hip)
    lower = upper @ rotate_x(np.pi - inner)
    return upper, lower, foot


def _arm(plan: Plan, side: int, chest: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """World rotations (N, 3, 3) of collar, shoulder and elbow frames in which the bone points down at rest."""
    sign = SIGNS[side]
    flexion, abduction, twist, elbow = np.moveaxis(plan.arms[:, side], -1, 0)
    upper = rotate_x(-flexion) @ rotate_z(sign * abduction) @ rotate_y(sign * twist)
    # The collar follows an arm that rises above the shoulder (smooth from there on).
    rise = np.maximum((upper @ DOWN)[:, 1] + 0.2, 0.0) ** 2
    collar = chest @ rotate_z(sign * 0.28 * rise)
    shoulder = chest @ upper
    return collar, shoulder, shoulder @ rotate_x(-elbow)


def _world_rotations(rig: DemoRig, plan: Plan, root: np.ndarray) -> np.ndarray:
    """(N, J, 3, 3) world rotation of every joint."""
    roles, offsets = rig.skeleton.roles, rig.offsets
    world = np.empty((plan.frames, len(rig.skeleton), 3, 3))
    pelvis = _pelvis(plan)
    world[:, roles["pelvis"]] = pelvis
    bend = plan.spine / 3
    third = rotate_y(bend[:, 2]) @ rotate_x(bend[:, 0]) @ rotate_z(-bend[:, 1])
    trunk = pelvis
    for name in ("spine1", "spine2", "spine3"):
        trunk = trunk @ third
        world[:, roles[name]] = trunk
    nod = plan.head / 2
    half = rotate_y(nod[:, 2]) @ rotate_x(nod[:, 0]) @ rotate_z(-nod[:, 1])
    world[:, roles["neck"]] = trunk @ half
    world[:, roles["head"]] = trunk @ half @ half
    for side in (0, 1):
        at = lambda part: rig.joint(side, part)  # noqa: B023, E731
        collar, shoulder, elbow = _arm(plan, side, trunk)
        world[:, at("collar")] = collar
        world[:, at("shoulder")] = shoulder @ _calibration(offsets[at("elbow")])
        world[:, at("elbow")] = world[:, at("wrist")] = elbow @ _calibration(offsets[at("wrist")])
        hip = root + pelvis @ offsets[at("hip")]
        upper, lower, foot = _leg(rig, plan, side, hip)
        world[:, at("hip")] = upper @ _calibration(offsets[at("knee")])
        world[:, at("knee")] = lower @ _calibration(offsets[at("ankle")])
        world[:, at("ankle")] = world[:, at("foot")] = foot
    return world


def _calibration(offset: np.ndarray) -> np.ndarray:
    """Rotation (3, 3) that takes a bone's rest direction to straight down."""
    return unitvectors_to_rotmat(offset / np.linalg.norm(offset), DOWN)


def solve(rig: DemoRig, plan: Plan, fps: float) -> Motion:
    """Place every joint.

    Args:
        rig: of the skeleton wanted.
        plan: control curves at `fps` (see `plan.sample`), already within reach.
        fps: frames per second of the curves.

    Returns:
        Motion with positions and true local rotations.
    """
    parents = rig.skeleton.parents
    root = _root(rig, plan)
    world = _world_rotations(rig, plan, root)
    positions = np.empty((plan.frames, len(parents), 3))
    positions[:, 0] = root
    for joint, parent in enumerate(parents[1:], start=1):
        positions[:, joint] = positions[:, parent] + world[:, parent] @ rig.offsets[joint]
    local = world.copy()
    local[:, 1:] = np.swapaxes(world[:, list(parents[1:])], -1, -2) @ world[:, 1:]
    return Motion(positions.astype(np.float32), fps, rig.skeleton, quat_continuation(rotmat_to_unitquat(local)))
