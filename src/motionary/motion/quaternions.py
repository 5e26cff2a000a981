"""Euler angles and quaternions (xyzw), as motion files need them, on numpy arrays of any leading shape.

Kept in numpy so that reading a file does not load torch.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Hamilton product of quaternions (..., 4) xyzw: the rotation `b` first, then `a`."""
    ax, ay, az, aw = np.moveaxis(a, -1, 0)
    bx, by, bz, bw = np.moveaxis(b, -1, 0)
    return np.stack(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ],
        axis=-1,
    )


def conjugate(q: np.ndarray) -> np.ndarray:
    """The inverse of unit quaternions (..., 4)."""
    return q * np.array([-1, -1, -1, 1], q.dtype)


def rotate(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) turned by unit quaternions (..., 4)."""
    u, w = q[..., :3], q[..., 3:]
    t = 2 * np.cross(u, v)
    return v + w * t + np.cross(u, t)


def from_euler(axes: Sequence[int], angles: np.ndarray) -> np.ndarray:
    """Quaternions of intrinsic rotations: R = R_axes[0](a0) R_axes[1](a1) ... as BVH applies its channels in order.

    Args:
        axes: 0, 1, 2 for x, y, z; any number of them, in the order written.
        angles: (..., len(axes)) radians.
    """
    result = np.zeros((*angles.shape[:-1], 4))
    result[..., 3] = 1.0
    for i, axis in enumerate(axes):
        half = angles[..., i] / 2
        turn = np.zeros_like(result)
        turn[..., axis], turn[..., 3] = np.sin(half), np.cos(half)
        result = multiply(result, turn) if i else turn
    return result


def to_matrix(q: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    x, y, z, w = np.moveaxis(np.asarray(q, np.float64), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def to_zxy(q: np.ndarray) -> np.ndarray:
    """Angles (..., 3) in radians with R = R_z(a) R_x(b) R_y(c), the order most BVH files use.

    At the poles (b = +-90 degrees) only a +- c is determined, and c is set to zero.
    """
    m = to_matrix(q)
    b = np.arcsin(np.clip(m[..., 2, 1], -1, 1))
    pole = np.abs(m[..., 2, 1]) > 1 - 1e-9
    a = np.where(pole, np.arctan2(m[..., 1, 0], m[..., 0, 0]), np.arctan2(-m[..., 0, 1], m[..., 1, 1]))
    c = np.where(pole, 0.0, np.arctan2(-m[..., 2, 0], m[..., 2, 2]))
    return np.stack([a, b, c], -1)
