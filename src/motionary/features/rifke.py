"""RIFKE, the skeleton features of Holden et al. that TEMOS learns (TEMOS 0.B.1), for any skeleton.

A frame is (yaw turned until the next frame, root velocity on the ground in the body's frame, root height, the other
joints in the body's frame): 3 J + 1 numbers, 64 on the 21 joints of the paper. The body's frame (TEMOS Fig. A.2) stands
on the ground below the root and faces where hips and shoulders together face. The paper's z is up; ours is y, and the
body's ahead is +z. The first frame's yaw is taken as 0, so that every motion starts with the same heading.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from motionary.features.columns import check_features, check_joints, tiled
from motionary.motion import Motion, Skeleton, heading
from motionary.motion.facing import rotate_y, wrap

if TYPE_CHECKING:
    import torch


class Rifke:
    """Codec between motions on one skeleton and RIFKE frames.

    Attributes:
        dim: features of a frame, 3 J + 1.
        slices: feature columns by group; "root_angular" is the whole angle in radians, lengths are metres a frame.
    """

    def __init__(self, skeleton: Skeleton):
        self.skeleton = skeleton
        widths = {"root_angular": 1, "root_linear": 2, "root_height": 1, "positions": 3 * (len(skeleton) - 1)}
        self.slices: Mapping[str, slice] = tiled(widths)
        self.dim = 3 * len(skeleton) + 1

    def encode(self, motion: Motion) -> np.ndarray:
        """(T - 1, dim) float32 features of T frames; blind to the first frame's horizontal position and heading.

        Raises:
            InputError: the motion has other joints.
        """
        check_joints(motion, self.skeleton)
        positions = motion.positions.astype(np.float64)
        yaw = heading(motion)
        local = positions.copy()
        local[..., [0, 2]] -= positions[:, :1, [0, 2]]
        local = rotate_y(local, -yaw[:, None])
        steps = rotate_y(np.diff(positions[:, 0], axis=0), -yaw[:-1])
        features = np.empty((motion.frames - 1, self.dim), np.float32)
        at = self.slices
        features[:, at["root_angular"]] = wrap(np.diff(yaw))[:, None]
        features[:, at["root_linear"]] = steps[:, [0, 2]]
        features[:, at["root_height"]] = positions[:-1, 0, 1:2]
        features[:, at["positions"]] = local[:-1, 1:].reshape(motion.frames - 1, 3 * (len(self.skeleton) - 1))
        return features

    def decode(self, features: np.ndarray, rotations: bool = False, fps: float = 20.0) -> Motion:
        """The motion of (T, dim) features, from the origin and heading 0 on.

        Args:
            features: raw (not normalized) features.
            rotations: these features hold none; true local ones are fitted (`motionary.motion.fit_rotations`).
            fps: of the result.

        Raises:
            InputError: wrong shape, or values that are not finite.
        """
        features = check_features(features, self.dim)
        yaw, ground = _integrated(features, self.slices)
        positions = np.empty((len(features), len(self.skeleton), 3))
        positions[:, 0] = np.stack([ground[:, 0], features[:, self.slices["root_height"]][:, 0], ground[:, 1]], -1)
        local = features[:, self.slices["positions"]].reshape(len(features), -1, 3)
        positions[:, 1:] = rotate_y(local, yaw[:, None])
        positions[:, 1:, [0, 2]] += ground[:, None]
        motion = Motion(positions.astype(np.float32), fps, self.skeleton)
        if not rotations:
            return motion
        from motionary.motion import fit_rotations

        return fit_rotations(motion)

    def root_path(self, features: torch.Tensor) -> torch.Tensor:
        """Ground positions (..., T, 2), x and z in metres, of raw features (..., T, dim): `decode`'s, for tensors."""
        import torch

        before = torch.nn.functional.pad(features[..., :-1, :], (0, 0, 1, 0))
        yaw = before[..., self.slices["root_angular"]][..., 0].cumsum(-1)
        # The step into a frame was measured in the frame before it.
        yaw = torch.nn.functional.pad(yaw[..., :-1], (1, 0))
        x, z = before[..., self.slices["root_linear"]].unbind(-1)
        cosine, sine = torch.cos(yaw), torch.sin(yaw)
        return torch.stack((cosine * x + sine * z, cosine * z - sine * x), -1).cumsum(-2)


def _integrated(features: np.ndarray, at: Mapping[str, slice]) -> tuple[np.ndarray, np.ndarray]:
    """(T,) yaws and (T, 2) ground positions of float64 features; the first frame is at the origin, facing ahead."""
    turned = features[:, at["root_angular"]][:, 0]
    yaw = np.cumsum(turned) - turned
    steps = np.zeros((len(features), 3))
    steps[:, [0, 2]] = features[:, at["root_linear"]]
    steps = rotate_y(steps, yaw)[:, [0, 2]]
    return yaw, np.cumsum(steps, axis=0) - steps
