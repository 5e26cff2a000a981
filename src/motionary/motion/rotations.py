"""Rotations on numpy arrays: unit quaternions xyzw (roma's order), and 3x3 matrices.

Interpolation and what needs it are roma's; it is imported late, since it brings torch.
"""

from __future__ import annotations

import numpy as np

TINY = 1e-8  # metres: a vector below this has no direction


def across(unit: np.ndarray) -> np.ndarray:
    """Some unit vector at right angles to each unit vector (..., 3)."""
    x, y, z = np.moveaxis(unit, -1, 0)
    zero = np.zeros_like(x)
    axis = np.where((np.abs(x) < 0.9)[..., None], np.stack([zero, z, -y], -1), np.stack([-z, zero, x], -1))
    return axis / np.linalg.norm(axis, axis=-1, keepdims=True)


def between(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """(..., 3, 3) least rotations from the directions of start (..., 3) to those of end (..., 3).

    Opposite directions turn about some axis across `start`; a vector without length gives the identity.
    """
    start, end = (v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), TINY) for v in (start, end))
    start, end = np.broadcast_arrays(start, end)
    cosine = (start * end).sum(-1)
    axis = np.cross(start, end)
    # Rodrigues' formula, R = 1 + [axis] + [axis]^2 / (1 + cosine), fails near opposite directions: there the turn is
    # a half turn about an axis across start, then the least rotation that remains.
    opposite = cosine < -1 + 1e-9
    near = np.where(opposite, 0.0, 1 / np.where(opposite, 1.0, 1 + cosine))
    skew = hat(axis)
    result = np.eye(3) + skew + skew @ skew * near[..., None, None]
    if opposite.any():
        side = across(start[opposite])
        result[opposite] = 2 * side[..., :, None] * side[..., None, :] - np.eye(3)
    lost = (np.abs(start).sum(-1) < 0.5) | (np.abs(end).sum(-1) < 0.5)
    result[lost] = np.eye(3)
    return result


def hat(vector: np.ndarray) -> np.ndarray:
    """(..., 3, 3) cross-product matrices of vectors (..., 3)."""
    result = np.zeros((*vector.shape, 3))
    result[..., 2, 1], result[..., 0, 2], result[..., 1, 0] = np.moveaxis(vector, -1, 0)
    result[..., 1, 2], result[..., 2, 0], result[..., 0, 1] = -np.moveaxis(vector, -1, 0)
    return result


def procrustes(covariance: np.ndarray) -> np.ndarray:
    """(..., 3, 3) rotations R that maximize tr(R^T covariance), covariance = sum of target source^T (Kabsch 1976)."""
    u, _, vt = np.linalg.svd(covariance)
    u[..., :, 2] *= np.where(np.linalg.det(u @ vt) < 0, -1.0, 1.0)[..., None]
    return u @ vt


def to_matrices(quaternions: np.ndarray) -> np.ndarray:
    """(..., 3, 3) float64 matrices of quaternions xyzw (..., 4), which need not be of length 1 to the last digit."""
    import roma
    import torch

    unit = torch.from_numpy(np.asarray(quaternions, dtype=np.float64))
    return roma.unitquat_to_rotmat(roma.quat_normalize(unit)).numpy()


def to_quaternions(matrices: np.ndarray) -> np.ndarray:
    """(..., 4) float32 quaternions xyzw of rotation matrices (..., 3, 3).

    Without roma: writing a file of a generated motion needs only this, and torch takes longer to import than the file
    to write. Shepperd's method ("Quaternion from rotation matrix", 1978): divide by the largest of the four.
    """
    m = np.asarray(matrices, dtype=np.float64)
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = (np.moveaxis(m[..., row, :], -1, 0) for row in range(3))
    x, y, z, w = 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz, 1 + xx + yy + zz
    rows = [
        [x, xy + yx, xz + zx, zy - yz],
        [xy + yx, y, yz + zy, xz - zx],
        [xz + zx, yz + zy, z, yx - xy],
        [zy - yz, xz - zx, yx - xy, w],
    ]
    candidates = np.stack([np.stack(row, -1) for row in rows], -2)
    largest = np.argmax(np.stack([x, y, z, w], -1), axis=-1)
    found = np.take_along_axis(candidates, largest[..., None, None], axis=-2)[..., 0, :]
    return (found / np.linalg.norm(found, axis=-1, keepdims=True)).astype(np.float32)


def slerp(start: np.ndarray, end: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Quaternions xyzw a share (T,) of the shorter way from start (T, J, 4) to end (T, J, 4), float32."""
    import roma
    import torch

    a, b = (torch.from_numpy(np.asarray(q, dtype=np.float64)) for q in (start, end))
    steps = torch.from_numpy(np.asarray(share, dtype=np.float64))
    # roma takes every step for every rotation; frames are interpolated one step each.
    angle = roma.unitquat_to_rotvec(roma.quat_product(roma.quat_conjugation(a), b), shortest_arc=True)
    turned = roma.quat_product(a, roma.rotvec_to_unitquat(angle * steps[:, None, None]))
    return roma.quat_normalize(turned).numpy().astype(np.float32)


def without_jumps(quaternions: np.ndarray) -> np.ndarray:
    """The same rotations (T, J, 4), each of the sign that is nearer to the frame before."""
    flips = np.where((quaternions[1:] * quaternions[:-1]).sum(-1) < 0, np.float32(-1), np.float32(1))
    signs = np.cumprod(np.concatenate([np.ones_like(quaternions[:1, :, 0]), flips]), axis=0)
    return quaternions * signs[..., None]
