"""People in many postures, in closed form: as rotations, as points, and as BVH files of any axes and rest pose."""

from __future__ import annotations

import numpy as np
from turned import ONTO, bvh_text, rest_frames

from motionary.motion import Skeleton
from motionary.motion.rotations import quat_action, quat_conjugation, quat_product

SMPL = Skeleton.named("smpl22")


def turn(axis: int, degrees: float | np.ndarray) -> np.ndarray:
    """Quaternions about one axis."""
    half = np.radians(np.asarray(degrees, np.float64)) / 2
    result = np.zeros((*half.shape, 4))
    result[..., axis], result[..., 3] = np.sin(half), np.cos(half)
    return result


# Root height (m), tilt of the trunk about x, and bends about x of hips and knees; arms are lowered and swing.
POSTURES = {
    "stands": (0.9, 0, 0, 0),
    "bows": (0.88, 60, -60, 0),
    "pushes": (0.85, 40, -25, 10),
    "sits on a chair": (0.5, 0, -90, 90),
    "sits on the floor": (0.1, 0, -90, 0),
    "crawls": (0.45, 90, -90, 90),
    "lies on the back": (0.12, -90, 0, 0),
    "lies on the belly": (0.12, 90, 0, 0),
}

_BENDS = {"hip": 30, "knee": 25, "shoulder": 40, "elbow": 30, "pelvis": 10}  # degrees


def person(posture: str, frames: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """World rotations (T, 22, 4) and root (T, 3) of a person who moves the arms, y up, in metres."""
    height, tilt, hip, knee = POSTURES[posture]
    swing = 20 * np.sin(np.linspace(0, 6, frames))
    local = np.tile([0.0, 0, 0, 1], (frames, 22, 1))
    local[:, 0] = turn(0, tilt)
    for joint, name in enumerate(SMPL.joints):
        side = 1 if name.startswith("left") else -1
        if name.endswith("hip"):
            local[:, joint] = turn(0, hip)
        elif name.endswith("knee"):
            local[:, joint] = turn(0, knee + 3.0)
        elif name.endswith("shoulder"):
            forward = -90 if posture in ("crawls", "pushes") else 0
            local[:, joint] = quat_product(turn(0, forward + swing * side), turn(2, np.full(frames, -75.0 * side)))
        elif name.endswith("elbow"):
            local[:, joint] = turn(1, np.full(frames, -25.0 * side))
    for joint, parent in enumerate(SMPL.parents[1:], 1):
        local[:, joint] = quat_product(local[:, parent], local[:, joint])
    root = np.stack([0.3 + 0.002 * np.arange(frames), np.full(frames, height), 0.4 + 0 * swing], -1)
    return local, root


def restless(posture: str, rng: np.random.Generator, frames: int) -> tuple[np.ndarray, np.ndarray]:
    """`person` whose limbs are bent further by chance, without regard to the floor, and move to and fro."""
    world, root = person(posture, frames)
    local, time = world.copy(), np.arange(frames) / 20
    for joint, parent in enumerate(SMPL.parents[1:], 1):
        local[:, joint] = quat_product(quat_conjugation(world[:, parent]), world[:, joint])
    for joint, name in enumerate(SMPL.joints):
        part = name.split("_")[-1]
        size = _BENDS.get(part, 8) * rng.uniform(0, 1.3)
        angle = size * (rng.normal() / 2 + rng.random() * np.sin(2 * np.pi * rng.uniform(0.2, 1.2) * time))
        local[:, joint] = quat_product(local[:, joint], turn(0, np.abs(angle) if part == "knee" else angle))
    for joint, parent in enumerate(SMPL.parents[1:], 1):
        local[:, joint] = quat_product(local[:, parent], local[:, joint])
    return local, root


def points(world: np.ndarray, root: np.ndarray) -> np.ndarray:
    """(T, 22, 3) joints."""
    positions = np.zeros((*world.shape[:2], 3))
    positions[:, 0] = root
    for joint, parent in enumerate(SMPL.parents[1:], 1):
        positions[:, joint] = positions[:, parent] + quat_action(world[:, parent], SMPL.offsets[joint].astype(float))
    return positions


def written(world: np.ndarray, root: np.ndarray, up: str, rest: str, scale: float = 100) -> str:
    """The person as a BVH file with another axis up and another rest pose."""
    frames = rest_frames(SMPL, rest)
    offsets = SMPL.offsets.astype(np.float64)
    for joint, parent in enumerate(SMPL.parents[1:], 1):
        offsets[joint] = quat_action(quat_conjugation(frames[parent]), offsets[joint])
    onto = np.broadcast_to(np.array(ONTO[up]), world.shape)
    world = quat_product(quat_product(onto, world), np.broadcast_to(frames, world.shape))
    return bvh_text(SMPL, offsets * scale, quat_action(np.array(ONTO[up]), root) * scale, world)
