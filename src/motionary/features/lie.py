"""Poses as Lie algebra vectors (thesis 3.2.1): each bone turned against the one before it, lengths and path apart.

A bone lies along the x-axis of its own frame. The frame of the root has x up, y ahead and z to the left, so that no
bone of a standing body points against the one before it, where its axis would be open. Where the chains of Eq. 3.4
branch off, they go on from the frame of the bone that they branch from: of a tree there is one product to every joint.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from motionary.errors import InputError
from motionary.features.columns import check_features, check_joints, tiled
from motionary.features.so3 import exp_so3
from motionary.motion import Motion, Skeleton
from motionary.motion.facing import forward_vectors, headings
from motionary.motion.kinematics import levels

_NO_BONE = 1e-9  # metres: a shorter bone has no direction
_ROOT = torch.tensor([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # columns: up, ahead, left


class ForwardKinematics(nn.Module):
    """Joints of a skeleton from Lie algebra vectors (Eq. 3.4), differentiable; bone lengths are the skeleton's.

    Args:
        skeleton: gives the tree and its bone lengths in metres.
    """

    bones: Tensor

    def __init__(self, skeleton: Skeleton):
        super().__init__()
        self.levels = _tree(skeleton)
        order = [0, *(joint for joints, _ in self.levels for joint in joints)]
        self.back = [order.index(joint) for joint in range(len(skeleton))]
        self.register_buffer("bones", torch.tensor(skeleton.bone_lengths), persistent=False)

    def forward(self, vectors: Tensor, bones: Tensor | None = None) -> Tensor:
        """(..., J, 3) joints relative to the root, in metres, of vectors (..., J, 3): the root's orientation in the
        world, then of every joint how the bone that ends there is turned. `bones` (J,) stand in for the skeleton's."""
        bones = (self.bones if bones is None else bones).to(vectors.dtype)
        local = exp_so3(vectors)  # (..., J, 3, 3)
        frames = local[..., :1, :, :] @ _ROOT.to(vectors)
        placed = [torch.zeros_like(vectors[..., :1, :])]
        for joints, parents in self.levels:
            frames = frames[..., parents, :, :] @ local[..., joints, :, :]
            placed.append(placed[-1][..., parents, :] + frames[..., 0] * bones[joints, None])
        return torch.cat(placed, -2)[..., self.back, :]


class Lie:
    """Codec between motions on one skeleton and Lie algebra features: of T frames T rows of 3 + 3 J numbers.

    Args:
        skeleton: of the motions; any tree.

    Attributes:
        dim: features of a frame.
        slices: "root_steps", by how many metres the root moved since the frame before (the first: since the origin),
            and "vectors", three radians for each joint.
    """

    def __init__(self, skeleton: Skeleton):
        self.skeleton = skeleton
        self.slices = tiled({"root_steps": 3, "vectors": 3 * len(skeleton)})
        self.dim = 3 + 3 * len(skeleton)
        self._kinematics = ForwardKinematics(skeleton)

    def bone_lengths(self, motion: Motion) -> np.ndarray:
        """(J,) median lengths over the frames of the bones that end in each joint, metres; 0 for the root."""
        positions = self._checked(motion)
        lengths = np.linalg.norm(positions - positions[:, np.maximum(self.skeleton.parents, 0)], axis=-1)
        return np.median(lengths, axis=0).astype(np.float32)

    def encode(self, motion: Motion) -> np.ndarray:
        """(T, dim) float32. A bone without length goes on in the direction of the one before it.

        Raises:
            InputError: the motion has other joints.
        """
        positions = self._checked(motion)
        facing = headings(forward_vectors(positions, self.skeleton.hips, self.skeleton.shoulders))
        vectors = np.zeros_like(positions)
        vectors[:, 0, 1] = facing
        frames = torch.zeros(*positions.shape, 3, dtype=torch.float64)
        frames[:, 0] = exp_so3(torch.from_numpy(vectors[:, 0])) @ _ROOT.double()
        for joints, parents in levels(self.skeleton):
            bones = torch.from_numpy(positions[:, joints] - positions[:, parents])
            before = frames[:, parents]
            found = least_turn((before.transpose(-1, -2) @ bones[..., None])[..., 0])
            vectors[:, joints], frames[:, joints] = found.numpy(), before @ exp_so3(found)
        steps = np.diff(positions[:, 0], axis=0, prepend=0.0)
        return np.concatenate([steps, vectors.reshape(len(vectors), -1)], 1).astype(np.float32)

    def decode(
        self, features: np.ndarray, fps: float = 20.0, bones: np.ndarray | None = None, scale: float = 1.0
    ) -> Motion:
        """The motion of (T, dim) features.

        Args:
            features: what :meth:`encode` gave.
            fps: of the result.
            bones: (J,) lengths in metres; None takes the skeleton's.
            scale: of the body: bones and root steps become so many times as long.

        Raises:
            InputError: a wrong shape, values that are not finite, or a scale that is not above 0.
        """
        features = check_features(features, self.dim)
        check_scale(scale)
        lengths = torch.from_numpy(np.asarray(self.skeleton.bone_lengths if bones is None else bones, np.float64))
        vectors = torch.from_numpy(features[:, self.slices["vectors"]]).unflatten(-1, (-1, 3))
        root = features[:, self.slices["root_steps"]].cumsum(0)
        positions = self._kinematics(vectors, lengths).numpy() + root[:, None]
        return Motion(scale * positions, fps, scaled(self.skeleton, scale))

    def _checked(self, motion: Motion) -> np.ndarray:
        check_joints(motion, self.skeleton)
        return motion.positions.astype(np.float64)


def _tree(skeleton: Skeleton) -> list[tuple[list[int], list[int]]]:
    """Joints by depth below the root, each level with the places of its parents in the level above."""
    found, above = [], [0]
    for joints, parents in levels(skeleton):
        found.append((joints, [above.index(parent) for parent in parents]))
        above = joints
    return found


def least_turn(vectors: Tensor) -> Tensor:
    """(..., 3) the least turns that bring the x-axis onto vectors (..., 3), as axis times angle.

    A vector without length needs none; for the opposite of the x-axis it is half a turn about z.
    """
    x, y, z = vectors.unbind(-1)
    across = torch.hypot(y, z)
    angle = torch.atan2(across, x)
    there = across > _NO_BONE
    share = torch.where(there, angle / torch.where(there, across, torch.ones_like(across)), torch.zeros_like(across))
    back = ~there & (x < -_NO_BONE)
    turns = torch.stack([torch.zeros_like(x), -z * share, y * share], -1)
    turns[..., 2] = torch.where(back, torch.full_like(x, torch.pi), turns[..., 2])
    return turns


def scaled(skeleton: Skeleton, scale: float) -> Skeleton:
    """The same tree with bones `scale` times as long; the skeleton itself for 1."""
    return skeleton if scale == 1 else skeleton.with_offsets(skeleton.offsets * np.float32(scale))


def check_scale(scale: float) -> None:
    """InputError unless a body's scale is a number above 0, at most 100."""
    if isinstance(scale, bool) or not isinstance(scale, int | float) or not 0 < scale <= 100:
        raise InputError("scale", scale, "must be a number above 0, at most 100")
