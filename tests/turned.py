"""Real motions as other programs would have written them: turned, scaled, mirrored, on other rest poses."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from motionary.formats.bvh_text import Node, render
from motionary.motion import Motion, Skeleton, fit_rotations
from motionary.motion.rotations import (
    quat_action,
    quat_conjugation,
    quat_product,
    rotmat_to_unitquat,
    unitquat_to_euler_zxy,
    vectors_to_rotmat,
)

HALF = np.sqrt(0.5)
# What turns y up into another axis up.
ONTO = {
    "y": [0, 0, 0, 1.0],
    "z": [HALF, 0, 0, HALF],
    "-y": [1.0, 0, 0, 0],
    "-z": [-HALF, 0, 0, HALF],
    "x": [0, 0, -HALF, HALF],
    "-x": [0, 0, HALF, HALF],
}
SCALES = {"m": 1.0, "cm": 100.0, "mm": 1000.0, "dm": 10.0, "in": 1 / 0.0254}
RESTS = ("t", "a", "x", "z")


@dataclass(frozen=True)
class Case:
    """One clip and what was done to it."""

    path: Path
    up: str
    unit: str
    mirrored: bool
    rest: str

    def array(self) -> np.ndarray:
        """(T, 22, 3) in the case's axes and unit."""
        points = np.load(self.path).astype(np.float64) * ([-1, 1, 1] if self.mirrored else 1)
        return quat_action(np.array(ONTO[self.up]), points) * SCALES[self.unit]

    def bvh(self) -> str:
        """The clip as a BVH file with the case's rest pose."""
        skeleton = Skeleton.named("smpl22")
        motion = fit_rotations(Motion(np.load(self.path), 20, skeleton))
        assert motion.rotations is not None
        world, root = motion.rotations.astype(np.float64), motion.positions[:, 0].astype(np.float64)
        world /= np.linalg.norm(world, axis=-1, keepdims=True)
        for joint, parent in enumerate(skeleton.parents[1:], 1):
            world[:, joint] = quat_product(world[:, parent], world[:, joint])
        frames = rest_frames(motion.skeleton, self.rest)
        offsets = motion.skeleton.offsets.astype(np.float64)
        for joint, parent in enumerate(skeleton.parents[1:], 1):
            offsets[joint] = quat_action(quat_conjugation(frames[parent]), offsets[joint])
        turn = np.broadcast_to(np.array(ONTO[self.up]), world.shape)
        if self.mirrored:
            flip = np.array([1.0, -1, -1, 1])
            world, frames, root, offsets = world * flip, frames * flip, root * [-1, 1, 1], offsets * [-1, 1, 1]
        world = quat_product(quat_product(turn, world), np.broadcast_to(frames, world.shape))
        root = quat_action(np.array(ONTO[self.up]), root)
        return bvh_text(skeleton, offsets * SCALES[self.unit], root * SCALES[self.unit], world)


def rest_frames(skeleton: Skeleton, rest: str) -> np.ndarray:
    """(J, 4) each joint's own axes in the T-pose, for a rest pose in which those are the world's."""
    frames = np.tile([0.0, 0, 0, 1], (len(skeleton), 1))
    for joint, name in enumerate(skeleton.joints):
        if rest == "z":
            frames[joint] = quat_conjugation(np.array(ONTO["z"]))
        elif rest == "a" and name.split("_")[-1] in ("shoulder", "elbow", "wrist"):
            angle = np.radians(50) / 2 * (1 if name.startswith("left") else -1)
            frames[joint] = [0, 0, np.sin(angle), np.cos(angle)]
        elif rest == "x":
            below = [k for k, parent in enumerate(skeleton.parents) if parent == joint]
            if below:
                bone = skeleton.offsets[below[-1]].astype(np.float64)
                frames[joint] = rotmat_to_unitquat(vectors_to_rotmat(np.array([1.0, 0, 0]), bone))
    return frames / np.linalg.norm(frames, axis=-1, keepdims=True)


def bvh_text(skeleton: Skeleton, offsets: np.ndarray, root: np.ndarray, world: np.ndarray, fps: float = 20) -> str:
    """A BVH file of global rotations (T, J, 4), rest offsets and root positions, in any unit and axes."""
    local = world.copy()
    for joint, parent in enumerate(skeleton.parents[1:], 1):
        local[:, joint] = quat_product(quat_conjugation(world[:, parent]), world[:, joint])
    angles = np.degrees(unitquat_to_euler_zxy(local))
    turns = [("rotation", axis) for axis in (2, 0, 1)]
    nodes = [
        Node(name, parent, False, tuple(map(float, offset)), list(turns))
        for name, parent, offset in zip(skeleton.joints, skeleton.parents, offsets, strict=True)
    ]
    nodes[0].channels = [("position", axis) for axis in range(3)] + turns
    order, stack = [], [0]
    while stack:
        order.append(joint := stack.pop())
        stack += [j for j in range(len(skeleton) - 1, 0, -1) if skeleton.parents[j] == joint]
    values = [angles[:, joint] for joint in order]
    return render(nodes, 1 / fps, np.concatenate([root, *values], axis=1))


def cases(data: Path, count: int, seed: int = 0) -> list[Case]:
    """Clips of all postures, a quarter of them on the floor, each done to by chance."""
    rng = np.random.default_rng(seed)
    floor, other = [], []
    for folder in ("captioned", "cmu", "styled"):
        for line in (data / folder / "clips.jsonl").read_text().splitlines():
            clip = json.loads(line)
            words = clip["motion"] + " ".join(caption["text"] for caption in clip.get("captions", []))
            on_floor = any(
                w in words.lower() for w in ("lie", "lying", "crawl", "floor", "sit", "cartwheel", "hand stand")
            )
            (floor if on_floor else other).append(data / folder / clip["motion"])
    chosen = [floor[i] for i in rng.choice(len(floor), count // 4, replace=False)]
    chosen += [other[i] for i in rng.choice(len(other), count - len(chosen), replace=False)]
    return [
        Case(
            path, *(str(rng.choice(list(d))) for d in (ONTO, SCALES)), bool(rng.random() < 0.5), str(rng.choice(RESTS))
        )
        for path in chosen
    ]
