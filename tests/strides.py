"""Bodies whose feet go where they are told: walkers and jumpers that stand still while they stand."""

from __future__ import annotations

import numpy as np

from motionary.motion import Motion, Skeleton
from motionary.motion.kinematics import local_turns, place
from motionary.motion.limbs import legs_of
from motionary.motion.rotations import quat_continuation, rotmat_to_unitquat

CYCLE, STANCE = 1.2, 0.6  # seconds of two steps, and the share of them that a foot stands


def stood(root: np.ndarray, feet: np.ndarray, fps: float, skeleton: Skeleton | None = None) -> Motion:
    """A body at rest but for its legs, whose root is at (T, 3) and whose left and right soles moved by (T, 2, 3)."""
    skeleton = skeleton or Skeleton.named("smpl22")
    points = np.tile(skeleton.rest, (len(root), 1, 1)) + root[:, None]
    turned = np.tile(np.eye(3), (len(root), len(skeleton), 1, 1))
    ground = skeleton.rest[:, 1].min()
    for side, leg in enumerate(legs_of(skeleton) or ()):
        goals = skeleton.rest[leg.feet] - [0, ground, 0] + feet[:, side, None]
        leg.reach(turned, points, goals)
    local = local_turns(skeleton, turned)
    return Motion(place(skeleton, local, root), fps, skeleton, quat_continuation(rotmat_to_unitquat(local)))


def walker(seconds: float = 6, fps: float = 20, speed: float = 0.9, skeleton: Skeleton | None = None) -> Motion:
    """Walks ahead; each foot stands to the millimetre."""
    time = np.arange(round(seconds * fps)) / fps
    feet = np.zeros((len(time), 2, 3))
    for side in (0, 1):
        phase = time / CYCLE + 0.5 * side
        step, share = np.floor(phase), np.clip((phase % 1 - STANCE) / (1 - STANCE), 0, 1)
        feet[:, side, 2] = (step - 0.5 * side + share**2 * (3 - 2 * share)) * speed * CYCLE
        feet[:, side, 1] = 0.14 * np.sin(np.pi * share) ** 2
    # A foot steps from as far behind the body as it comes to stand before it.
    behind = speed * CYCLE * STANCE / 2
    return stood(np.stack([0 * time, 0 * time + 0.86, speed * time - behind + 0.3], -1), feet, fps, skeleton)


def jumper(fps: float = 20, ahead: float = 0.8) -> Motion:
    """Stands for a second, jumps ahead, flies for half a second, stands."""
    time = np.arange(round(3 * fps)) / fps
    share = np.clip((time - 1) / 0.5, 0, 1)
    up, on = 4 * 0.35 * share * (1 - share), np.stack([0 * share, 0 * share, share * ahead], -1)
    root = on + np.stack([0 * up, 0.86 + 0.8 * up, 0 * up], -1)
    return stood(root, np.repeat((on + np.stack([0 * up, up, 0 * up], -1))[:, None], 2, 1), fps)


def slid(motion: Motion, velocity: tuple[float, float]) -> Motion:
    """The motion on a belt that runs at a velocity over the ground (x, z) in m/s."""
    time = np.arange(motion.frames)[:, None] / motion.fps
    shift = np.concatenate([velocity[0] * time, 0 * time, velocity[1] * time], axis=-1)
    return Motion(motion.positions + shift[:, None], motion.fps, motion.skeleton, motion.rotations)


def on_the_floor(motion: Motion) -> np.ndarray:
    """(T, J, 3) where its joints are once the lowest of all frames touches the ground."""
    return motion.positions - np.array([0, motion.positions[..., 1].min(), 0], np.float32)
