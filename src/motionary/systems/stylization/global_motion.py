"""The root's velocities from local motion alone: a small convolutional network (thesis 5.2.2, "Global Motion
Prediction")."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from motionary.errors import InputError
from motionary.nn.convolutions import SLOPE, keep, step_mask
from motionary.nn.layers import Normalizer, length_mask, masked_mean


@dataclass(frozen=True)
class GlobalMotionConfig:
    """Attributes:
    width: channels of the two hidden layers.
    kernel: frames that each of the three layers sees; odd.
    """

    width: int = 128
    kernel: int = 3

    def __post_init__(self) -> None:
        if self.width < 1:
            raise InputError("global_motion.width", self.width, "must be at least 1")
        if self.kernel < 1 or self.kernel % 2 == 0:
            raise InputError("global_motion.kernel", self.kernel, "must be odd and positive")


class GlobalMotion(nn.Module):
    """Three convolutions over time, trained on unlabeled motion by mean absolute error."""

    def __init__(self, config: GlobalMotionConfig, context: Any):
        super().__init__()
        self.config, self.context = config, context
        self.normalizer = Normalizer(context.mean, context.std)
        self.root = context.make_codec().slices["root_linear"].stop
        channels = [context.dim - self.root, config.width, config.width, self.root]
        self.layers = nn.ModuleList(
            nn.Conv1d(inputs, outputs, config.kernel, padding=config.kernel // 2)
            for inputs, outputs in itertools.pairwise(channels)
        )

    def forward(self, local: Tensor, frames: Tensor | None = None) -> Tensor:
        """local (B, T, local_dim), frames (B,) | None -> root velocities (B, T, 3): angular, x and z; both sides
        normalized, zero beyond the frames. An item's result does not depend on the rest of the batch."""
        x = local.transpose(1, 2)
        mask = step_mask(frames, x)
        x = keep(x, mask)
        for layer in self.layers[:-1]:
            x = keep(F.leaky_relu(layer(x), SLOPE), mask)
        return keep(self.layers[-1](x), mask).transpose(1, 2)

    def loss(self, batch: Any, progress: float, generator: torch.Generator) -> tuple[Tensor, dict[str, Tensor]]:
        """Mean absolute error of the normalized velocities over valid frames."""
        away, mask = self._away(batch)
        return masked_mean(away.abs(), mask), {}

    @torch.no_grad()
    def validate(self, batch: Any) -> dict[str, Tensor]:
        """The loss, and the error of the root's horizontal speed in m/s."""
        away, mask = self._away(batch)
        speed = (away[..., 1:] * self.normalizer.std[1 : self.root]).norm(dim=-1) * self.context.fps
        return {"loss": masked_mean(away.abs(), mask), "speed_error": masked_mean(speed, mask)}

    def _away(self, batch: Any) -> tuple[Tensor, Tensor]:
        """Predicted less true velocities (B, T, 3), normalized, and the mask (B, T) of valid frames."""
        known = self.normalizer(batch.motion)
        predicted = self(known[..., self.root :], batch.frames)
        return predicted - known[..., : self.root], length_mask(batch.frames, known.shape[1])
