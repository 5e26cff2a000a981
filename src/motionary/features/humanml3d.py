"""The HumanML3D features of Guo et al. (thesis 4.4, "Pose Representation"), exactly as released, for any skeleton.

A frame is (root angular velocity, root linear velocity x z, root height, local joint positions, 6-D rotations,
velocities, four foot contacts): 12 J - 1 numbers. Three habits of the released extractor are kept, since published
features and numbers depend on them:

- the smoothed facing is computed with the left and right hip swapped (shoulders minus hips, not plus);
- arm chains start from the root rotation, not from the spine's, and bones rotate from raw axis-aligned directions:
  the 6-D rotations are therefore not the body's local rotations (`motionary.motion.fit_rotations` has those);
- the root angular velocity is half the angle turned in a frame, and 0 is the heading of the first frame.

Two faults are not kept: bones without length and directions opposite to the raw ones gave NaN, and the angular
velocity changed its sign in the frame where the heading passes 180 degrees.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from motionary.features import bones
from motionary.features.columns import check_features, check_joints, tiled
from motionary.motion import Motion, Skeleton
from motionary.motion.contacts import CONTACT_THRESHOLD, foot_contacts
from motionary.motion.facing import fill_short, forward_vectors, headings, rotate_y, wrap
from motionary.motion.rotations import euler_to_rotmat, sixd_to_rotmat

if TYPE_CHECKING:
    import torch

_SIGMA = 20  # frames: width of the facing filter
_CONTACTS = 4


class HumanML3D:
    """Codec between motions on one skeleton and feature frames.

    Args:
        skeleton: every joint but the root must end exactly one bone of its chains.
        contact_threshold: a foot stands where its squared step is below this, m^2 per frame^2 at 20 fps.

    Attributes:
        dim: features of a frame, 12 J - 1.
        slices: feature columns by group.
    """

    def __init__(self, skeleton: Skeleton, contact_threshold: float = CONTACT_THRESHOLD):
        self.skeleton = skeleton
        self.contact_threshold = contact_threshold
        joints = len(skeleton)
        self.dim = 12 * joints - 1
        self.slices: Mapping[str, slice] = _slices(joints)
        self._order, self._before = bones.chain_order(skeleton)
        self._hips, self._shoulders = skeleton.hips, skeleton.shoulders
        if skeleton.codec_swaps_sides:
            self._hips, self._shoulders = _swapped(self._hips), _swapped(self._shoulders)

    def encode(self, motion: Motion) -> np.ndarray:
        """(T - 1, dim) float32 features of T frames; blind to the first frame's horizontal position and heading.

        Heights are taken as they are: `motionary.motion.canonicalize` puts the floor at 0.

        Raises:
            InputError: the motion has another number of joints.
        """
        check_joints(motion, self.skeleton)
        positions = motion.positions.astype(np.float64)
        positions = rotate_y(positions, -headings(forward_vectors(positions, self._hips, self._shoulders))[0])
        half = self._half_angles(positions)
        turn = 2 * half[:, None]
        local = positions.copy()
        local[..., [0, 2]] -= positions[:, :1, [0, 2]]
        local = rotate_y(local, turn)
        steps = np.diff(positions, axis=0)

        features = np.empty((motion.frames - 1, self.dim), np.float32)
        at = self.slices
        features[:, at["root_angular"]] = wrap(np.diff(half), np.pi)[:, None]
        features[:, at["root_linear"]] = rotate_y(steps[:, 0], 2 * half[1:])[:, [0, 2]]
        features[:, at["root_height"]] = positions[:-1, 0, 1:2]
        features[:, at["positions"]] = _rows(local[:-1, 1:])
        features[:, at["rotations"]] = _rows(self._rotations(positions[:-1], half[:-1]))
        features[:, at["velocities"]] = _rows(rotate_y(steps, turn[:-1]))
        features[:, at["contacts"]] = self._contacts(motion)
        return features

    def decode(self, features: np.ndarray, rotations: bool = False, fps: float = 20.0) -> Motion:
        """The motion of (T, dim) features, from the origin and heading 0 on.

        Args:
            features: raw (not normalized) features.
            rotations: place the joints by the 6-D rotations and the skeleton's bone lengths, not by the positions.
            fps: of the result.

        Raises:
            InputError: wrong shape, or values that are not finite.
        """
        features = check_features(features, self.dim)
        joints = len(self.skeleton)
        if not rotations:
            return Motion(recover_positions(features, joints), fps, self.skeleton)
        half, root = _recover_root(features)
        sixd = features[:, self.slices["rotations"]].reshape(len(features), joints - 1, 6)
        return Motion(self._place(sixd, half, root), fps, self.skeleton)

    def root_path(self, features: torch.Tensor) -> torch.Tensor:
        """Ground positions (..., T, 2), x and z in metres, of raw features (..., T, dim): `decode`'s, for tensors."""
        return _ground_path(features)

    def joints(self, features: torch.Tensor) -> torch.Tensor:
        """Joint positions (..., T, J, 3) in metres of raw features (..., T, dim): `decode`'s, for tensors."""
        return recover_positions_torch(features, len(self.skeleton))

    @property
    def contact_joints(self) -> tuple[int, ...]:
        """The joint that each column of "contacts" is about."""
        feet = tuple(self.skeleton.feet)
        return feet[2:] + feet[:2] if self.skeleton.codec_swaps_sides else feet

    def _half_angles(self, positions: np.ndarray) -> np.ndarray:
        """(T,) half the angle about y that turns the smoothed facing to +z: the released root quaternion's."""
        forward = _smooth(forward_vectors(positions, _swapped(self._hips), self._shoulders))
        forward = fill_short(forward, np.array([0.0, 1.0]))
        half = -np.arctan2(forward[:, 0], forward[:, 1]) / 2
        half[0] = 0.0
        return half

    def _rotations(self, positions: np.ndarray, half: np.ndarray) -> np.ndarray:
        """(T, J - 1, 6): first two columns of each bone's rotation relative to the bone before it in its chain.

        Products along a chain collapse: a joint's accumulated rotation is the one from its raw bone to its bone.
        """
        root = np.stack([np.zeros_like(half), np.sin(half), np.zeros_like(half), np.cos(half)])
        moved = positions.transpose(2, 0, 1)
        vectors = moved[..., self._order[:, 1]] - moved[..., self._order[:, 0]]
        turned = bones.between(self.skeleton.codec_directions[self._order[:, 1]].T[:, None], vectors)
        turned = bones.hold_unknown(turned, root, self._before)
        before = np.concatenate([root[..., None], turned], axis=-1)[..., self._before + 1]
        sixd = bones.first_columns(bones.relative(before, turned))
        result = np.empty((len(positions), len(self.skeleton), 6))
        result[:, self._order[:, 1]] = sixd.transpose(1, 2, 0)
        return result[:, 1:]

    def _place(self, sixd: np.ndarray, half: np.ndarray, root: np.ndarray) -> np.ndarray:
        """Forward kinematics of the released rotations: (T, J, 3) positions."""
        local = sixd_to_rotmat(sixd.astype(np.float64))
        # The released root rotation turns the body to +z, so its chains start from there.
        start = euler_to_rotmat(1, 2 * half)
        bone = self.skeleton.codec_directions * self.skeleton.bone_lengths[:, None]
        turned, positions = [], np.empty((len(sixd), len(self.skeleton), 3))
        positions[:, 0] = root
        for (parent, joint), before in zip(self._order, self._before, strict=True):
            turned.append((start if before < 0 else turned[before]) @ local[:, joint - 1])
            positions[:, joint] = positions[:, parent] + turned[-1] @ bone[joint]
        return positions

    def _contacts(self, motion: Motion) -> np.ndarray:
        contacts = foot_contacts(motion, self.contact_threshold)
        return contacts[:, [2, 3, 0, 1]] if self.skeleton.codec_swaps_sides else contacts


def recover_positions(features: np.ndarray, joints: int) -> np.ndarray:
    """(..., T, J, 3) float32 joint positions of (..., T, 12 J - 1) raw features, from the origin and heading 0 on."""
    features = features.astype(np.float64)
    half, root = _recover_root(features)
    local = features[..., 4 : 3 * joints + 1].reshape(*features.shape[:-1], joints - 1, 3)
    positions = np.empty((*features.shape[:-1], joints, 3), np.float32)
    positions[..., 0, :] = root
    positions[..., 1:, :] = rotate_y(local, -2 * half[..., None])
    positions[..., 1:, 0] += root[..., None, 0]
    positions[..., 1:, 2] += root[..., None, 2]
    return positions


def recover_positions_torch(features: torch.Tensor, joints: int) -> torch.Tensor:
    """`recover_positions` for tensors: differentiable, any leading dimensions, (..., T, D) -> (..., T, J, 3)."""
    import torch

    half = torch.cumsum(features[..., 0], dim=-1) - features[..., 0]
    root_x, root_z = _ground_path(features).unbind(-1)
    cosine, sine = torch.cos(2 * half), torch.sin(2 * half)
    local = features[..., 4 : 3 * joints + 1].unflatten(-1, (joints - 1, 3))
    cosine, sine = cosine[..., None], sine[..., None]
    body = torch.stack(
        [
            cosine * local[..., 0] - sine * local[..., 2] + root_x[..., None],
            local[..., 1],
            cosine * local[..., 2] + sine * local[..., 0] + root_z[..., None],
        ],
        dim=-1,
    )
    root = torch.stack([root_x, features[..., 3], root_z], dim=-1)
    return torch.cat([root[..., None, :], body], dim=-2)


def _ground_path(features: torch.Tensor) -> torch.Tensor:
    """(..., T, 2): frame t stands where the velocities of the frames before it lead."""
    import torch

    previous = torch.nn.functional.pad(features[..., :-1, :3], (0, 0, 1, 0))
    # A step belongs to the heading of the frame that it leads to; the angles are half of it.
    half = previous[..., 0].cumsum(-1)
    x, z = previous[..., 1], previous[..., 2]
    cosine, sine = torch.cos(2 * half), torch.sin(2 * half)
    return torch.stack((cosine * x - sine * z, sine * x + cosine * z), -1).cumsum(-2)


def _recover_root(features: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(..., T) half angles and (..., T, 3) root positions that float64 features integrate to."""
    half = np.cumsum(features[..., 0], axis=-1) - features[..., 0]
    steps = np.zeros((*features.shape[:-1], 3))
    steps[..., 1:, 0], steps[..., 1:, 2] = features[..., :-1, 1], features[..., :-1, 2]
    # A step belongs to the heading of the frame that it leads to.
    root = np.cumsum(rotate_y(steps, -2 * half), axis=-2)
    root[..., 1] = features[..., 3]
    return half, root


def _rows(values: np.ndarray) -> np.ndarray:
    """(T, n, m) as (T, n m), for T = 0 too."""
    return values.reshape(len(values), values.shape[1] * values.shape[2])


def _swapped(sides: tuple[int, int]) -> tuple[int, int]:
    return sides[1], sides[0]


def _smooth(vectors: np.ndarray) -> np.ndarray:
    """Gaussian filter over frames, cut at 4 sigma, the ends held (as scipy's gaussian_filter1d, mode "nearest")."""
    radius = 4 * _SIGMA
    kernel = np.exp(-0.5 * (np.arange(-radius, radius + 1) / _SIGMA) ** 2)
    kernel /= kernel.sum()
    padded = np.pad(vectors, ((radius, radius), (0, 0)), mode="edge")
    return np.stack([np.convolve(column, kernel, mode="valid") for column in padded.T], axis=-1)


def _slices(joints: int) -> dict[str, slice]:
    widths = {
        "root_angular": 1,
        "root_linear": 2,
        "root_height": 1,
        "positions": 3 * (joints - 1),
        "rotations": 6 * (joints - 1),
        "velocities": 3 * joints,
        "contacts": _CONTACTS,
    }
    return tiled(widths)
