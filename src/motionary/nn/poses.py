"""Pose vectors: what networks that write motion frame by frame read and write of a frame's joints.

A pose has 3 J numbers: the root's velocity to the side (x, m/s), its height (m), its velocity ahead (z, m/s), then the
other joints relative to the root (m). Places on the ground have no meaning of their own, and heights must not drift, so
the ground path is relative translation (thesis 3.2.1: "works better") and the height is taken as it is.
"""

from __future__ import annotations

import torch
from torch import Tensor

ROOT = 3  # numbers of the root, before those of the other joints


def to_poses(joints: Tensor, fps: float) -> Tensor:
    """(..., T, J, 3) joints in metres -> (..., T, 3 J) poses; the first frame's velocity is that from the origin."""
    root = joints[..., 0, :]
    before = torch.nn.functional.pad(root[..., :-1, :], (0, 0, 1, 0))
    speed = (root - before) * fps
    local = (joints[..., 1:, :] - joints[..., :1, :]).flatten(-2)
    return torch.cat([torch.stack([speed[..., 0], root[..., 1], speed[..., 2]], -1), local], -1)


def to_joints(poses: Tensor, fps: float) -> Tensor:
    """(..., T, 3 J) poses -> (..., T, J, 3) joints: the inverse of :func:`to_poses`."""
    path = poses[..., [0, 2]].cumsum(-2) / fps
    root = torch.stack([path[..., 0], poses[..., 1], path[..., 1]], -1)[..., None, :]
    local = poses[..., ROOT:].unflatten(-1, (-1, 3))
    return torch.cat([root, local + root], -2)
