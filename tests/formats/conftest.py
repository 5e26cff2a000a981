"""A small moving person for format tests."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.motion import Motion, Skeleton


def walker(skeleton: Skeleton | None = None, frames: int = 20, fps: float = 20.0, seed: int = 0) -> Motion:
    """A figure with smooth random joint rotations, walking along +z; rotations are true."""
    from motionary.motion.rotations import quat_action, quat_product

    skeleton = skeleton or Skeleton.named("smpl22")
    rng = np.random.default_rng(seed)
    joints = len(skeleton.joints)
    phase = np.linspace(0, 2, frames)[:, None]
    axis = rng.normal(size=(joints, 3))
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    half = 0.2 * np.sin(phase + rng.uniform(0, 6, joints))
    rotations = np.concatenate([axis * np.sin(half)[..., None], np.cos(half)[..., None]], -1)
    positions = np.zeros((frames, joints, 3))
    positions[:, 0] = np.stack([0 * phase[:, 0], 0.95 + 0 * phase[:, 0], phase[:, 0]], -1)
    turned = rotations.copy()
    for j, p in enumerate(skeleton.parents[1:], 1):
        turned[:, j] = quat_product(turned[:, p], rotations[:, j])
        positions[:, j] = positions[:, p] + quat_action(turned[:, p], skeleton.offsets[j])
    return Motion(positions, fps, skeleton, rotations)


@pytest.fixture
def person() -> Motion:
    return walker()


@pytest.fixture
def make_walker():
    return walker
