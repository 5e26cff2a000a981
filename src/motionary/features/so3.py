"""The exponential and the logarithm map of rotations, for tensors of any leading shape (thesis 3.2.1).

Both are safe wherever their textbook forms divide by zero: values and gradients stay finite at the angles 0 and pi.
"""

from __future__ import annotations

import torch
from torch import Tensor

_SMALL = 1e-4  # squared angle below which series stand in for quotients


def hat_tensor(w: Tensor) -> Tensor:
    """(..., 3, 3) skew-symmetric matrices of vectors (..., 3) (Eq. 3.2)."""
    x, y, z = w.unbind(-1)
    zero = torch.zeros_like(x)
    return torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).unflatten(-1, (3, 3))


def exp_so3(w: Tensor) -> Tensor:
    """(..., 3, 3) rotations of axis times angle in radians (..., 3), by Rodrigues' formula; any angle is allowed."""
    squared = w.square().sum(-1)
    small = squared < _SMALL
    angle = torch.where(small, torch.ones_like(squared), squared).sqrt()  # so that no root has an infinite gradient
    sine = torch.where(small, 1 - squared / 6 + squared.square() / 120, angle.sin() / angle)
    half = (angle / 2).sin() / angle  # (1 - cos) / angle^2 = 2 sin^2(angle / 2) / angle^2 keeps its digits
    cosine = torch.where(small, 0.5 - squared / 24 + squared.square() / 720, 2 * half.square())
    skew = hat_tensor(w)
    eye = torch.eye(3, dtype=w.dtype, device=w.device)
    return eye + sine[..., None, None] * skew + cosine[..., None, None] * (skew @ skew)


def log_so3(rotation: Tensor) -> Tensor:
    """(..., 3) axis times angle of rotations (..., 3, 3), of length at most pi.

    Eq. 3.3 divides by the sine of the angle, which is lost near pi; here the way leads over the unit quaternion, by its
    largest component (Shepperd, 1978). At pi itself both directions of the axis are right, and one of them is taken.
    """
    quaternion = _quaternion(rotation)
    quaternion = torch.where(quaternion[..., 3:] < 0, -quaternion, quaternion)
    vector, real = quaternion[..., :3], quaternion[..., 3]
    squared = vector.square().sum(-1)
    small = squared < _SMALL
    sine = torch.where(small, torch.ones_like(squared), squared).sqrt()
    # 2 atan(s / c) / s = 2 / c (1 - (s / c)^2 / 3 + (s / c)^4 / 5 - ...)
    ratio = squared / torch.where(small, real, torch.ones_like(real)).square()
    series = 2 / torch.where(small, real, torch.ones_like(real)) * (1 - ratio / 3 + ratio.square() / 5)
    factor = torch.where(small, series, 2 * torch.atan2(sine, real) / sine)
    return factor[..., None] * vector


def _quaternion(rotation: Tensor) -> Tensor:
    """(..., 4) unit quaternions xyzw of rotations."""
    m = rotation
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    squares = torch.stack([1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz, 1 + xx + yy + zz], -1)
    x, y, z, w = squares.unbind(-1)
    xy, xz, yz = m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]
    wx, wy, wz = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    rows = torch.stack([x, xy, xz, wx, xy, y, yz, wy, xz, yz, z, wz, wx, wy, wz, w], -1).unflatten(-1, (4, 4))
    largest = squares.argmax(-1)[..., None, None].expand(*squares.shape[:-1], 1, 4)
    found = rows.gather(-2, largest)[..., 0, :]
    return found / found.norm(dim=-1, keepdim=True)
