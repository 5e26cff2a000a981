"""Rotations on numpy arrays of any leading shape, with roma's names: unit quaternions xyzw and 3x3 matrices.

roma itself brings torch and its compiler, which take seconds to import; reading, writing and resampling need neither.
The tests hold these functions against roma and scipy.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

TINY = 1e-8  # metres: a vector below this has no direction


def quat_product(a: np.ndarray, b: np.ndarray, axis: int = -1) -> np.ndarray:
    """Hamilton product of quaternions, broadcast: the rotation `b` first, then `a`.

    Args:
        a, b: (..., 4) xyzw; with another `axis`, the one that holds the four components.
        axis: of the components.
    """
    ax, ay, az, aw = np.moveaxis(a, axis, 0)
    bx, by, bz, bw = np.moveaxis(b, axis, 0)
    return np.stack(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ],
        axis=axis,
    )


def quat_conjugation(q: np.ndarray) -> np.ndarray:
    """The inverse of unit quaternions (..., 4)."""
    return q * np.array([-1, -1, -1, 1], q.dtype)


def quat_action(q: np.ndarray, v: np.ndarray, axis: int = -1) -> np.ndarray:
    """Vectors (..., 3) turned by unit quaternions (..., 4), broadcast; `axis` holds the components of both."""
    ux, uy, uz, w = np.moveaxis(q, axis, 0)
    vx, vy, vz = np.moveaxis(v, axis, 0)
    # t = 2 u x v; v + w t + u x t
    tx, ty, tz = 2 * (uy * vz - uz * vy), 2 * (uz * vx - ux * vz), 2 * (ux * vy - uy * vx)
    return np.stack(
        [
            vx + w * tx + (uy * tz - uz * ty),
            vy + w * ty + (uz * tx - ux * tz),
            vz + w * tz + (ux * ty - uy * tx),
        ],
        axis=axis,
    )


def quat_continuation(q: np.ndarray) -> np.ndarray:
    """The same rotations (T, ..., 4), each quaternion of the sign that is nearer to the frame before."""
    flips = np.where((q[1:] * q[:-1]).sum(-1) < 0, -1, 1)
    signs = np.cumprod(np.concatenate([np.ones_like(q[:1, ..., 0]), flips]), axis=0).astype(q.dtype)
    return q * signs[..., None]


def unitquat_slerp(start: np.ndarray, end: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Quaternions a share (T,) of the shorter way from start (T, J, 4) to end (T, J, 4), float64."""
    a, b = (np.asarray(q, np.float64) for q in (start, end))
    way = quat_product(quat_conjugation(a), b)
    way = np.where(way[..., 3:] < 0, -way, way)
    sine = np.linalg.norm(way[..., :3], axis=-1, keepdims=True)
    half, step = np.arctan2(sine, way[..., 3:]), np.asarray(share, np.float64)[:, None, None]
    # Where both are one rotation, its axis has no length and every share of the way is the share of nothing.
    scale = np.where(sine > 1e-12, np.sin(step * half) / np.maximum(sine, 1e-12), step)
    turned = quat_product(a, np.concatenate([way[..., :3] * scale, np.cos(step * half)], axis=-1))
    return turned / np.linalg.norm(turned, axis=-1, keepdims=True)


def unitquat_to_rotmat(q: np.ndarray) -> np.ndarray:
    """(..., 3, 3) float64 matrices of quaternions (..., 4), which need not be of length 1 to the last digit."""
    q = np.asarray(q, np.float64)
    x, y, z, w = np.moveaxis(q / np.linalg.norm(q, axis=-1, keepdims=True), -1, 0)
    xx, yy, zz, ww = x * x, y * y, z * z, w * w
    rows = [
        [xx - yy - zz + ww, 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), -xx + yy - zz + ww, 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), -xx - yy + zz + ww],
    ]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def rotmat_to_unitquat(matrices: np.ndarray) -> np.ndarray:
    """(..., 4) float64 quaternions of rotation matrices (..., 3, 3).

    Shepperd's method ("Quaternion from rotation matrix", 1978): divide by the largest of the four components.
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
    return found / np.linalg.norm(found, axis=-1, keepdims=True)


def unitquat_to_rotvec(q: np.ndarray) -> np.ndarray:
    """Rotation vectors (..., 3) in radians, of length at most pi, of unit quaternions (..., 4)."""
    q = np.where(q[..., 3:] < 0, -q, q)
    sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., 3:])
    return q[..., :3] * np.where(sine > TINY, angle / np.maximum(sine, TINY), 2.0)


def rotvec_to_unitquat(vectors: np.ndarray) -> np.ndarray:
    """Unit quaternions (..., 4) of rotation vectors (..., 3) in radians."""
    half = np.linalg.norm(vectors, axis=-1, keepdims=True) / 2
    return np.concatenate([vectors * np.sinc(half / np.pi) / 2, np.cos(half)], axis=-1)


def euler_to_unitquat(axes: Sequence[int], angles: np.ndarray) -> np.ndarray:
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
        result = quat_product(result, turn) if i else turn
    return result


def unitquat_to_euler_zxy(q: np.ndarray) -> np.ndarray:
    """Angles (..., 3) in radians with R = R_z(a) R_x(b) R_y(c), the order most BVH files use.

    At the poles (b = +-90 degrees) only a +- c is determined, and c is set to zero.
    """
    m = unitquat_to_rotmat(q)
    b = np.arcsin(np.clip(m[..., 2, 1], -1, 1))
    pole = np.abs(m[..., 2, 1]) > 1 - 1e-9
    a = np.where(pole, np.arctan2(m[..., 1, 0], m[..., 0, 0]), np.arctan2(-m[..., 0, 1], m[..., 1, 1]))
    c = np.where(pole, 0.0, np.arctan2(-m[..., 2, 0], m[..., 2, 2]))
    return np.stack([a, b, c], -1)


def unitquat_to_euler(axes: Sequence[int], q: np.ndarray) -> np.ndarray:
    """Angles (..., 3) in radians with R = R_axes[0](a) R_axes[1](b) R_axes[2](c), for three different axes.

    At the poles (b = +-90 degrees) only a +- c is determined, and c is set to zero.
    """
    m, (i, j, k) = unitquat_to_rotmat(q), axes
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    b = np.arcsin(np.clip(sign * m[..., i, k], -1, 1))
    pole = np.abs(m[..., i, k]) > 1 - 1e-9
    a = np.where(pole, sign * np.arctan2(m[..., k, j], m[..., j, j]), sign * np.arctan2(-m[..., j, k], m[..., k, k]))
    c = np.where(pole, 0.0, sign * np.arctan2(-m[..., i, j], m[..., i, i]))
    return np.stack([a, b, c], -1)


def euler_to_rotmat(axis: int, angle: np.ndarray | float) -> np.ndarray:
    """(..., 3, 3) rotations about one axis (0, 1, 2 for x, y, z) by angles (...) in radians."""
    angle = np.asarray(angle, dtype=np.float64)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    result = np.zeros((*angle.shape, 3, 3))
    cosine, sine = np.cos(angle), np.sin(angle)
    result[..., axis, axis] = 1.0
    result[..., i, i] = result[..., j, j] = cosine
    result[..., i, j], result[..., j, i] = -sine, sine
    return result


def sixd_to_rotmat(sixd: np.ndarray) -> np.ndarray:
    """(..., 3, 3) rotation matrices of 6-D rotations (..., 6) by Gram-Schmidt (Zhou et al. 2019), finite for any."""
    first = _direction(sixd[..., :3], np.array([1.0, 0.0, 0.0]))
    # Columns in line leave the turn about the first open: take any.
    third = _direction(np.cross(first, sixd[..., 3:]), orthogonal(first))
    return np.stack([first, np.cross(third, first), third], axis=-1)


def special_procrustes(covariance: np.ndarray) -> np.ndarray:
    """(..., 3, 3) rotations R that maximize tr(R^T covariance), covariance = sum of target source^T (Kabsch 1976)."""
    u, _, vt = np.linalg.svd(covariance)
    u[..., :, 2] *= np.where(np.linalg.det(u @ vt) < 0, -1.0, 1.0)[..., None]
    return u @ vt


def vectors_to_rotmat(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """(..., 3, 3) least rotations from the directions of start (..., 3) to those of end (..., 3).

    Opposite directions turn about some axis across `start`; a vector without length gives the identity.
    """
    start, end = (v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), TINY) for v in (start, end))
    result = unitvectors_to_rotmat(start, end)
    result[(np.abs(start).sum(-1) < 0.5) | (np.abs(end).sum(-1) < 0.5)] = np.eye(3)
    return result


def unitvectors_to_rotmat(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """`vectors_to_rotmat` for vectors of length 1."""
    start, end = np.broadcast_arrays(start, end)
    cosine = (start * end).sum(-1)
    skew = hat(np.cross(start, end))
    # Rodrigues' formula, R = 1 + [axis] + [axis]^2 / (1 + cosine), fails near opposite directions: there the turn is
    # a half turn about an axis across start.
    opposite = cosine < -1 + 1e-9
    # Near there 1 + cosine loses its digits; of vectors of length 1 it is |start + end|^2 / 2.
    share = np.where(cosine < -1 + 1e-6, np.square(start + end).sum(-1) / 2, 1 + cosine)
    result = np.eye(3) + skew + skew @ skew / np.where(opposite, 1.0, share)[..., None, None]
    if opposite.any():
        side = orthogonal(start[opposite])
        result[opposite] = 2 * side[..., :, None] * side[..., None, :] - np.eye(3)
    return result


def hat(vector: np.ndarray) -> np.ndarray:
    """(..., 3, 3) cross-product matrices of vectors (..., 3)."""
    result = np.zeros((*vector.shape, 3))
    result[..., 2, 1], result[..., 0, 2], result[..., 1, 0] = np.moveaxis(vector, -1, 0)
    result[..., 1, 2], result[..., 2, 0], result[..., 0, 1] = -np.moveaxis(vector, -1, 0)
    return result


def orthogonal(unit: np.ndarray) -> np.ndarray:
    """Some unit vector at right angles to each unit vector (..., 3)."""
    x, y, z = np.moveaxis(unit, -1, 0)
    zero = np.zeros_like(x)
    axis = np.where((np.abs(x) < 0.9)[..., None], np.stack([zero, z, -y], -1), np.stack([-z, zero, x], -1))
    return axis / np.linalg.norm(axis, axis=-1, keepdims=True)


def _direction(vectors: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > TINY, vectors / np.maximum(length, TINY), otherwise)
