"""What the second judge sees of a motion: joints at a fixed rate, of one body size, the same from every side."""

from __future__ import annotations

import torch
from torch import Tensor

from motionary.motion import Skeleton
from motionary.nn.layers import length_mask

POSE, SPEED, PATH = 0.25, 1.0, 2.0  # metres and m/s that become one: about the deviations of people who move
TINY = 1e-6


def channels(joints: int) -> int:
    """Numbers of a step that :func:`describe` gives."""
    return 6 * joints + 7


class View:
    """Turns joint positions into what the judge reads, and varies them in training.

    Args:
        skeleton: of the motions.
        fps: of the motions.
        rate: steps a second that are read.
    """

    def __init__(self, skeleton: Skeleton, fps: float, rate: float):
        self.skeleton, self.stride = skeleton, fps / rate
        self.rate = rate
        self.bones = [(j, p) for j, p in enumerate(skeleton.parents) if p >= 0]
        self.size = float(sum(skeleton.bone_lengths[j] for j, _ in self.bones))
        self.rest = torch.tensor(skeleton.rest, dtype=torch.float32)

    def __call__(self, joints: Tensor, frames: Tensor, tempo: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Steps of motions.

        Args:
            joints: (B, T, J, 3) positions in metres, y up.
            frames: (B,) valid ones.
            tempo: (B,) how much faster each motion is read; None is 1.

        Returns:
            (B, S, channels) numbers of each step, zero beyond the valid ones, and their count (B,). Where the motion
            begins, which way it faces then and how large the body is change nothing.
        """
        x, steps = self._resampled(joints.float(), frames, tempo)
        mask = length_mask(steps, x.shape[1])
        x = x * self._scale(x, mask)[:, None, None, None]
        ground = x[:, :, :1, [0, 2]]  # (B, S, 1, 2) the root's path
        forward = self._forward(x)  # (B, S, 2) unit x and z of where the body faces
        local = torch.cat([_turned(x[..., [0, 2]] - ground, forward[:, :, None]), x[..., 1:2]], -1)  # (B, S, J, 3)
        path = ground[:, :, 0] - ground[:, :1, 0]
        root = [
            _turned(_rates(path, self.rate), forward) / SPEED,
            _turned(path, forward[:, :1]) / PATH,
            _turned(forward, forward[:, :1]),
            self._turn(forward)[..., None],
        ]
        pose = (local - self.rest.to(x.device)[:, [0, 2, 1]]) / POSE
        speed = _rates(local.flatten(2), self.rate) / SPEED
        return torch.cat([pose.flatten(2), speed, *root], -1) * mask[..., None], steps

    def other_bones(self, joints: Tensor, spread: float, generator: torch.Generator) -> Tensor:
        """The motions (B, T, J, 3) on bodies whose bones are longer or shorter, by factors exp(`spread` N(0, 1)), alike
        left and right; the root stays."""
        draws = torch.randn(len(joints), joints.shape[2], generator=generator, device=joints.device)
        factors = (spread * draws).exp()
        for left, right in self.skeleton.pairs:
            factors[:, right] = factors[:, left]
        out = joints.clone()
        for joint, parent in self.bones:  # parents come first
            out[:, :, joint] = out[:, :, parent] + factors[:, None, joint, None] * (
                joints[:, :, joint] - joints[:, :, parent]
            )
        return out

    def _resampled(self, joints: Tensor, frames: Tensor, tempo: Tensor | None) -> tuple[Tensor, Tensor]:
        """Linear between frames: every `stride` frames, or as many times `tempo`."""
        stride = torch.full((len(joints),), self.stride, device=joints.device)
        stride = stride if tempo is None else stride * tempo
        steps = ((frames - 1) / stride + TINY).floor().long() + 1
        at = torch.arange(int(steps.max()), device=joints.device) * stride[:, None]  # (B, S)
        at = torch.minimum(at, (frames - 1)[:, None].to(at.dtype))
        before = at.floor().long()
        after = torch.minimum(before + 1, (frames - 1)[:, None])
        item = torch.arange(len(joints), device=joints.device)[:, None]
        return torch.lerp(joints[item, before], joints[item, after], (at - before)[..., None, None]), steps

    def _scale(self, x: Tensor, mask: Tensor) -> Tensor:
        """(B,) factor that gives each body the skeleton's size, the sum of its bones."""
        child, parent = (list(column) for column in zip(*self.bones, strict=True))
        length = (x[:, :, child] - x[:, :, parent]).norm(dim=-1).sum(-1)  # (B, S)
        mean = (length * mask).sum(1) / mask.sum(1)
        return self.size / mean.clamp(min=0.1 * self.size)

    def _forward(self, x: Tensor) -> Tensor:
        """(B, S, 2) unit x and z across hips and shoulders, turned by a right angle."""
        (left_hip, right_hip), (left, right) = self.skeleton.hips, self.skeleton.shoulders
        across = x[:, :, left_hip] - x[:, :, right_hip] + x[:, :, left] - x[:, :, right]
        flat = across[..., [0, 2]]  # the body's left
        flat = torch.where(flat.norm(dim=-1, keepdim=True) > TINY, flat, flat.new_tensor([1.0, 0.0]))
        left_x, left_z = (flat / flat.norm(dim=-1, keepdim=True)).unbind(-1)
        return torch.stack([-left_z, left_x], -1)

    def _turn(self, forward: Tensor) -> Tensor:
        """(B, S) radians a second about the upright."""
        before = torch.cat([forward[:, :1], forward[:, :-1]], 1)
        sine = before[..., 1] * forward[..., 0] - before[..., 0] * forward[..., 1]
        return torch.atan2(sine, (before * forward).sum(-1)) * self.rate


def _turned(flat: Tensor, forward: Tensor) -> Tensor:
    """(..., 2) x and z in the frame whose second axis is `forward` (..., 2) and whose first is the left of it."""
    x, z = flat.unbind(-1)
    forward_x, forward_z = forward.unbind(-1)
    return torch.stack([x * forward_z - z * forward_x, x * forward_x + z * forward_z], -1)


def _rates(x: Tensor, rate: float) -> Tensor:
    """Change a second of (B, S, C) from the step before; none at the first."""
    return torch.cat([torch.zeros_like(x[:, :1]), (x[:, 1:] - x[:, :-1]) * rate], 1)
