"""Bodies in motion whose rotations are known."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.motion import Motion, Skeleton, forward_kinematics


def _wriggling(skeleton: Skeleton, frames: int = 60, seed: int = 0, size: float = 0.5, fps: float = 20.0) -> Motion:
    """Every joint turns smoothly about random axes by up to about `size` radians; the root wanders and turns."""
    rng = np.random.default_rng(seed)
    time = np.linspace(0, 2 * np.pi, frames)[:, None, None]
    waves = rng.normal(size=(3, 2, len(skeleton), 3)) * size / 2
    vectors = sum(waves[k, 0] * np.sin((k + 1) * time) + waves[k, 1] * np.cos((k + 1) * time) for k in range(3))
    vectors[:, 0] = np.array([0, 1, 0]) * np.linspace(0.3, 3, frames)[:, None] + 0.2 * vectors[:, 0]
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    rotations = np.concatenate([vectors / angle * np.sin(angle / 2), np.cos(angle / 2)], axis=-1)
    root = np.cumsum(rng.normal(size=(frames, 3)), axis=0) * 0.02 + np.array([0, 1, 0])
    return Motion(forward_kinematics(skeleton, rotations, root), fps, skeleton, rotations)


def _moved(motion: Motion, angle: float, shift: tuple[float, float, float] = (0, 0, 0)) -> Motion:
    """Positions turned by angle about +y (+z towards +x), then shifted."""
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
    return Motion(motion.positions @ turn.T + np.array(shift), motion.fps, motion.skeleton)


def _planted(motion: Motion) -> np.ndarray:
    """(T - 1, 4) the contacts that `foot_skating` takes, to be looked at again on another body."""
    feet = motion.positions[:, list(motion.skeleton.feet)].astype(np.float64)
    low = feet[..., 1] - np.percentile(feet[..., 1], 5, axis=0) < 0.015 * np.array([2, 1, 2, 1])
    down = (low[:, 0::2] & low[:, 1::2]).repeat(2, axis=1)
    return down[1:] & down[:-1]


@pytest.fixture(scope="session")
def planted():
    return _planted


@pytest.fixture(scope="session")
def wriggling():
    return _wriggling


@pytest.fixture(scope="session")
def moved():
    return _moved


@pytest.fixture(scope="session")
def smpl() -> Skeleton:
    return Skeleton.named("smpl22")


@pytest.fixture(scope="session")
def kit() -> Skeleton:
    return Skeleton.named("kit21")


@pytest.fixture(scope="session")
def t_pose(smpl) -> np.ndarray:
    """(22, 3) joints of smpl22 at rest, the pelvis at the origin."""
    rest = np.zeros((22, 3))
    for joint, parent in enumerate(smpl.parents[1:], 1):
        rest[joint] = rest[parent] + smpl.offsets[joint]
    return rest
