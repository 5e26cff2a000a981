"""What reconstruction losses and errors share: weights of features, distances, joint errors in millimetres."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from motionary.features import Columns
from motionary.nn.layers import length_mask, masked_mean


def feature_weights(features: int, positions: Columns, position_weight: float) -> Tensor:
    """(D,) weights of a reconstruction loss, mean 1: the columns of local joint positions weigh 1 + position_weight
    before scaling."""
    weights = torch.ones(features)
    weights[positions] += position_weight
    return weights / weights.mean()


def distance(difference: Tensor, square_from: float) -> Tensor:
    """Elementwise reconstruction error of normalized features: L1 (Eq. 4.2), or squared where it is large.

    A positive `square_from` makes errors beyond that many deviations count by their square, continued smoothly (the
    reverse Huber function). Under L1 alone a network that trains for minutes settles on the median, which leaves out
    what few clips do for a short time: turning around, waving, clapping.
    """
    error = difference.abs()
    if not square_from:
        return error
    return torch.where(error < square_from, error, (error.square() / square_from + square_from) / 2)


def position_error(decoded: Tensor, raw: Tensor, frames: Tensor, positions: Columns) -> Tensor:
    """Mean error of the local joint positions (root and heading removed), in millimetres.

    Compares raw features' own local positions, in the columns `positions` of all joints but the root.
    """
    a, b = decoded[..., positions], raw[:, : decoded.shape[1], positions]  # (B, T, 3 (J - 1))
    count = a.shape[-1] // 3
    error = (a - b).unflatten(-1, (count, 3)).norm(dim=-1).sum(-1)  # (B, T)
    # The root is where it is in both: it counts as a joint without error.
    return 1000 * masked_mean(error / (count + 1), length_mask(frames, decoded.shape[1]))


def foot_speed(joints: Tensor, feet: Sequence[int], stands: Tensor, mask: Tensor, fps: float) -> Tensor:
    """Mean speed in m/s of feet where they stand, over all feet and steps: a loss on sliding.

    Args:
        joints: (B, T, J, 3) metres, the root integrated.
        feet: F of the joints.
        stands: (B, T - 1, F) from 0 to 1, whether each stands until the next frame.
        mask: (B, T) valid frames.
        fps: frames per second.
    """
    steps = joints[..., list(feet), :].diff(dim=1)
    # A hair above 0, where a square root has no finite slope.
    speed = (steps.square().sum(-1) + 1e-8).sqrt() * fps  # (B, T - 1, F)
    return masked_mean(stands * speed, mask[:, 1:])
