"""The rotation form of a motion, which animates a skinned character (TEMOS 0.B.2), for any skeleton.

A frame is (the root's global rotation, every other joint's local rotation, both as the first two columns of their
matrices (Zhou et al. 2019), root velocity on the ground, root height): 6 J + 3 numbers, 135 on 22 joints. The paper's
z is up; ours is y. The whole motion is turned so that its first frame faces ahead; unlike RIFKE's, the velocity is
that of the ground and not of the body.

The rotations are the true local ones of `Motion`, not those of the HumanML3D features. Decoding places the joints on
the codec's own skeleton, as the paper's average body does: a motion on other bone lengths comes back in these
proportions.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from motionary.features.columns import check_features, check_joints, tiled
from motionary.motion import Motion, Skeleton, fit_rotations, heading
from motionary.motion.facing import rotate_y
from motionary.motion.kinematics import place
from motionary.motion.rotations import (
    quat_continuation,
    quat_product,
    rotmat_to_unitquat,
    sixd_to_rotmat,
    unitquat_to_rotmat,
)

if TYPE_CHECKING:
    import torch


class Rotations:
    """Codec between motions on one skeleton and frames of rotations.

    Attributes:
        dim: features of a frame, 6 J + 3.
        slices: feature columns by group; "root_linear" is metres a frame along x and z of the first frame's heading.
    """

    def __init__(self, skeleton: Skeleton):
        self.skeleton = skeleton
        widths = {"root_rotation": 6, "rotations": 6 * (len(skeleton) - 1), "root_linear": 2, "root_height": 1}
        self.slices: Mapping[str, slice] = tiled(widths)
        self.dim = 6 * len(skeleton) + 3

    def encode(self, motion: Motion) -> np.ndarray:
        """(T - 1, dim) float32 features of T frames; blind to the first frame's horizontal position and heading.

        Rotations that a motion lacks are fitted to its joints (`motionary.motion.fit_rotations`).

        Raises:
            InputError: the motion has other joints.
        """
        check_joints(motion, self.skeleton)
        yaw = float(heading(motion)[0])
        known = motion if motion.rotations is not None else fit_rotations(motion)
        assert known.rotations is not None
        quaternions = known.rotations.astype(np.float64)
        back = np.array([0.0, np.sin(-yaw / 2), 0.0, np.cos(-yaw / 2)])
        quaternions[:, 0] = quat_product(back, quaternions[:, 0])
        root = rotate_y(motion.positions[:, 0].astype(np.float64), -yaw)
        matrices = unitquat_to_rotmat(quaternions[:-1])
        sixd = np.concatenate([matrices[..., 0], matrices[..., 1]], axis=-1)
        features = np.empty((motion.frames - 1, self.dim), np.float32)
        features[:, self.slices["root_rotation"]] = sixd[:, 0]
        features[:, self.slices["rotations"]] = sixd[:, 1:].reshape(motion.frames - 1, 6 * (len(self.skeleton) - 1))
        features[:, self.slices["root_linear"]] = np.diff(root, axis=0)[:, [0, 2]]
        features[:, self.slices["root_height"]] = root[:-1, 1:2]
        return features

    def decode(self, features: np.ndarray, rotations: bool = False, fps: float = 20.0) -> Motion:
        """The motion of (T, dim) features, with its rotations, from the origin on.

        Args:
            features: raw (not normalized) features.
            rotations: changes nothing: these features hold nothing else.
            fps: of the result.

        Raises:
            InputError: wrong shape, or values that are not finite.
        """
        features = check_features(features, self.dim)
        first, rest = features[:, self.slices["root_rotation"]], features[:, self.slices["rotations"]]
        sixd = np.concatenate([first, rest], axis=1).reshape(len(features), len(self.skeleton), 6)
        matrices = sixd_to_rotmat(sixd)
        root = np.empty((len(features), 3))
        steps = features[:, self.slices["root_linear"]]
        root[:, [0, 2]] = np.cumsum(steps, axis=0) - steps
        root[:, 1] = features[:, self.slices["root_height"]][:, 0]
        quaternions = quat_continuation(rotmat_to_unitquat(matrices)).astype(np.float32)
        positions = place(self.skeleton, matrices, root).astype(np.float32)
        return Motion(positions, fps, self.skeleton, quaternions)

    def root_path(self, features: torch.Tensor) -> torch.Tensor:
        """Ground positions (..., T, 2), x and z in metres, of raw features (..., T, dim): `decode`'s, for tensors."""
        steps = features[..., self.slices["root_linear"]]
        return steps.cumsum(-2) - steps
