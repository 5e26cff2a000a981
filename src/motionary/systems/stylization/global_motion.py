"""The root's velocities from local motion alone: a small convolutional network (thesis 5.2.2, "Global Motion
Prediction")."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from motionary.corpus.batch import MotionBatch
from motionary.corpus.context import Context
from motionary.errors import WIDEST, InputError, check_range
from motionary.nn.convolutions import SLOPE, keep, step_mask
from motionary.nn.layers import Normalizer, length_mask, masked_mean
from motionary.nn.precision import widened
from motionary.systems.stylization.local_motion import LocalMotion
from motionary.systems.trainable import Loss, Trainable


@dataclass(frozen=True)
class GlobalMotionConfig:
    """Settings of the prediction of global motion (thesis 5.2.2); conf/global_motion.yaml explains each."""

    width: int = 128
    kernel: int = 3

    def __post_init__(self) -> None:
        check_range("global_motion", self, ("width",), 1, WIDEST)
        check_range("global_motion", self, ("kernel",), 1, 1023)
        if self.kernel % 2 == 0:
            raise InputError("global_motion.kernel", self.kernel, "must be odd")


class GlobalMotion(Trainable):
    """Three convolutions over time, trained on unlabeled motion by mean absolute error."""

    def __init__(self, config: GlobalMotionConfig, context: Context):
        super().__init__()
        self.config, self.context = config, context
        self.normalizer = Normalizer(context.mean, context.std)
        self.parts = LocalMotion(context)
        channels = [self.parts.dim, config.width, config.width, self.parts.root_dim]
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
        return widened(keep(self.layers[-1](x), mask).transpose(1, 2))

    def loss(self, batch: MotionBatch, progress: float, generator: torch.Generator) -> Loss:
        """Mean absolute error of the normalized velocities over valid frames."""
        away, mask = self._away(batch)
        return masked_mean(away.abs(), mask), {}

    @torch.no_grad()
    def validate(self, batch: MotionBatch) -> dict[str, Tensor]:
        """The loss, and the error of the root's horizontal speed in m/s."""
        away, mask = self._away(batch)
        ground = away[..., 1:] * self.normalizer.std[self.parts.root][1:]  # (B, T, 2): the first turns
        speed = ground.norm(dim=-1) * self.context.fps
        return {"loss": masked_mean(away.abs(), mask), "speed_error": masked_mean(speed, mask)}

    def _away(self, batch: MotionBatch) -> tuple[Tensor, Tensor]:
        """Predicted less true velocities (B, T, 3), normalized, and the mask (B, T) of valid frames."""
        known = self.normalizer(batch.motion)  # (B, T, D)
        predicted = self(known[..., self.parts.local], batch.frames)
        return predicted - known[..., self.parts.root], length_mask(batch.frames, known.shape[1])
