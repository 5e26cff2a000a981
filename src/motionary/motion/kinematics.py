"""Forward kinematics."""

from __future__ import annotations

import numpy as np

from motionary.errors import InputError
from motionary.motion.motion import Motion
from motionary.motion.rotations import unitquat_to_rotmat
from motionary.motion.skeleton import Skeleton


def forward_kinematics(skeleton: Skeleton, rotations: np.ndarray, root_positions: np.ndarray) -> np.ndarray:
    """(..., J, 3) float32 joint positions: x_j = x_parent + R_parent offset_j, R_j = R_parent R_local,j.

    Args:
        skeleton: gives parents and rest offsets.
        rotations: (..., J, 4) local unit quaternions xyzw; the root's is global.
        root_positions: (..., 3) metres.

    Raises:
        InputError: shapes that do not fit.
    """
    rotations, root_positions = np.asarray(rotations), np.asarray(root_positions)
    if rotations.ndim < 2 or rotations.shape[-2:] != (len(skeleton), 4):
        raise InputError("rotations", rotations.shape, f"shape (..., {len(skeleton)}, 4)")
    if root_positions.shape != (*rotations.shape[:-2], 3):
        raise InputError("root_positions", root_positions.shape, f"shape {(*rotations.shape[:-2], 3)}")
    return place(skeleton, unitquat_to_rotmat(rotations), root_positions).astype(np.float32)


def agrees(motion: Motion, tolerance: float = 1e-3) -> bool:
    """Whether a motion has rotations that place its joints within a tolerance in metres."""
    if motion.rotations is None:
        return False
    placed = place(motion.skeleton, unitquat_to_rotmat(motion.rotations), motion.positions[:, 0])
    return bool(np.linalg.norm(placed - motion.positions, axis=-1).max() < tolerance)


def place(skeleton: Skeleton, local: np.ndarray, root_positions: np.ndarray) -> np.ndarray:
    """(..., J, 3) float64 joint positions of local matrices (..., J, 3, 3), one level of the tree at a time."""
    turned = local.astype(np.float64)
    positions = np.empty((*local.shape[:-2], 3))
    positions[..., 0, :] = root_positions
    offsets = skeleton.offsets.astype(np.float64)
    for joints, parents in levels(skeleton):
        base = turned[..., parents, :, :]
        positions[..., joints, :] = positions[..., parents, :] + (base @ offsets[joints, :, None])[..., 0]
        turned[..., joints, :, :] = base @ turned[..., joints, :, :]
    return positions


def levels(skeleton: Skeleton) -> list[tuple[list[int], list[int]]]:
    """Joints by depth below the root, each level with its parents."""
    depth = [0] * len(skeleton)
    for joint, parent in enumerate(skeleton.parents[1:], 1):
        depth[joint] = depth[parent] + 1
    groups = ([j for j, d in enumerate(depth) if d == level] for level in range(1, max(depth) + 1))
    return [(joints, [skeleton.parents[j] for j in joints]) for joints in groups]


def global_turns(skeleton: Skeleton, local: np.ndarray) -> np.ndarray:
    """(T, J, 3, 3) float64 rotations of joints in the world, from those relative to their parents."""
    turned = local.astype(np.float64)
    for joint, parent in enumerate(skeleton.parents[1:], 1):
        turned[:, joint] = turned[:, parent] @ local[:, joint]
    return turned


def local_turns(skeleton: Skeleton, turned: np.ndarray) -> np.ndarray:
    """(T, J, 3, 3) rotations of joints relative to their parents, from those in the world."""
    local = turned.copy()
    parents = list(skeleton.parents[1:])
    local[:, 1:] = turned[:, parents].swapaxes(-1, -2) @ turned[:, 1:]
    return local
