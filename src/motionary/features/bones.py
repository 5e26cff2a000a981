"""The bone rotations behind the HumanML3D features: quaternions xyzw, components first, all joints at once."""

from __future__ import annotations

import numpy as np

from motionary.errors import InputError
from motionary.motion import Skeleton
from motionary.motion.rotations import orthogonal, quat_product

_NO_BONE = 1e-5  # metres: the direction of a shorter bone is rounding


def chain_order(skeleton: Skeleton) -> tuple[np.ndarray, np.ndarray]:
    """Bones in chain order.

    Returns:
        (J - 1, 2) joints where each bone begins and ends, and (J - 1,) the number of the bone before it in its chain,
        -1 for the first of a chain.

    Raises:
        InputError: the chains do not reach every joint once, or begin at a joint not reached yet.
    """
    order: list[tuple[int, int]] = []
    before: list[int] = []
    reached = {0}
    for chain in skeleton.chains:
        if chain[0] not in reached:
            raise InputError(f"skeleton {skeleton.name}", chain, "a chain must begin at a joint of an earlier chain")
        for k in range(len(chain) - 1):
            before.append(-1 if k == 0 else len(order) - 1)
            order.append((chain[k], chain[k + 1]))
            reached.add(chain[k + 1])
    if len(order) != len(skeleton) - 1 or len(reached) != len(skeleton):
        raise InputError(f"skeleton {skeleton.name}", skeleton.chains, "chains must reach every joint exactly once")
    return np.array(order, dtype=np.int64).reshape(-1, 2), np.array(before, dtype=np.int64)


def between(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The least rotation from unit vectors start (3, ...) to the directions of end (3, ...), as (4, ...).

    Opposite directions turn about a fixed axis across `start`; a vector without length gives the zero quaternion.
    """
    x, y, z = start
    a, b, c = end
    length = np.sqrt(a * a + b * b + c * c)
    turn = np.stack([y * c - z * b, z * a - x * c, x * b - y * a, length + x * a + y * b + z * c])
    norm = np.sqrt((turn * turn).sum(axis=0))
    opposite = (norm < 1e-7 * length) & (length > _NO_BONE)
    if opposite.any():
        axes = np.zeros_like(turn)
        axes[:3] = np.moveaxis(orthogonal(np.moveaxis(start, 0, -1)), -1, 0)
        turn, norm = np.where(opposite, axes, turn), np.where(opposite, 1.0, norm)
    return np.where(length > _NO_BONE, turn / np.maximum(norm, 1e-30), 0.0)


def hold_unknown(turned: np.ndarray, root: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Zero quaternions of (4, T, bones) replaced by the rotation of the bone before (root (4, T) before the first)."""
    unknown = np.asarray(~turned.any(axis=0))
    for bone in np.flatnonzero(unknown.any(axis=0)):
        source = root if before[bone] < 0 else turned[..., before[bone]]
        turned[..., bone] = np.where(unknown[:, bone], source, turned[..., bone])
    return turned


def relative(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """before^-1 after, unit quaternions (4, ...)."""
    x, y, z, w = before
    return quat_product(np.stack([-x, -y, -z, w]), after, axis=0)


def first_columns(quaternion: np.ndarray) -> np.ndarray:
    """(6, ...): the first two columns of the matrices of unit quaternions (4, ...) (Zhou et al. 2019)."""
    x, y, z, w = quaternion
    return np.stack(
        [
            1 - 2 * (y * y + z * z),
            2 * (x * y + z * w),
            2 * (x * z - y * w),
            2 * (x * y - z * w),
            1 - 2 * (x * x + z * z),
            2 * (y * z + x * w),
        ]
    )
