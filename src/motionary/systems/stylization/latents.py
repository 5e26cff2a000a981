"""Motion codes for stylization: a convolutional autoencoder of local motion, four frames to a code (thesis 5.2.1)."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from motionary.corpus.batch import MotionBatch
from motionary.corpus.context import Context
from motionary.errors import HEAVIEST, WIDEST, InputError, check_range
from motionary.features import UNIT
from motionary.nn.convolutions import Down, Up, coarser, finer, keep, step_mask
from motionary.nn.layers import Normalizer, length_mask, masked_mean
from motionary.nn.precision import widened
from motionary.nn.reconstruction import position_error
from motionary.nn.snippets import prepare
from motionary.systems.stylization.local_motion import LocalMotion
from motionary.systems.trainable import Loss, Trainable

VARIANTS = ("V", "A", "none")
LARGEST = 4.0  # of a log-variance, either way: beyond, one odd clip's noise throws the whole training off


@dataclass(frozen=True)
class LatentsConfig:
    """Settings of the motion codes that stylization works on (thesis 5.2.1); conf/latents.yaml explains each."""

    variant: str = "V"
    width: int = 512
    code_dim: int = 512
    kl_weight: float = 0.001
    sparsity_weight: float = 0.001
    smoothness_weight: float = 0.001

    def __post_init__(self) -> None:
        if self.variant not in VARIANTS:
            raise InputError("latents.variant", self.variant, f"must be one of {', '.join(VARIANTS)}")
        check_range("latents", self, ("width", "code_dim"), 1, WIDEST)
        check_range("latents", self, ("kl_weight", "sparsity_weight", "smoothness_weight"), 0, HEAVIEST)


class Latents(Trainable):
    """E and D of thesis 5.2.1: local motion <-> codes. Channels come first inside: codes are (B, D_z, T/4).

    Local motion is the codec's features without the root's three velocities: 260 of HumanML3D's 263, which stand in
    for the thesis's own 260. The root's velocities come from :mod:`motionary.systems.stylization.global_motion`.

    Attributes:
        local_dim: features of local motion.
        dim: channels of a code.
    """

    def __init__(self, config: LatentsConfig, context: Context):
        super().__init__()
        self.config, self.context = config, context
        self.normalizer = Normalizer(context.mean, context.std)
        self.parts, self.positions = LocalMotion(context), context.columns("positions")
        self.local_dim = self.parts.dim
        self.dim = UNIT * self.local_dim if config.variant == "none" else config.code_dim
        if config.variant == "none":
            return
        width, codes = config.width, config.code_dim
        self.first = Down(self.local_dim, width)
        self.second = nn.Conv1d(width, 2 * codes if config.variant == "V" else codes, 4, stride=2, padding=1)
        self.up_first = Up(codes, width, transposed=True)
        self.up_second = nn.ConvTranspose1d(width, self.local_dim, 4, stride=2, padding=1)

    def local(self, raw: Tensor) -> Tensor:
        """Raw features (..., D) -> normalized local motion (..., local_dim)."""
        return self.normalizer(raw)[..., self.parts.local]

    def root(self, raw: Tensor) -> Tensor:
        """Raw features (..., D) -> the root's normalized velocities (..., 3): angular, x and z."""
        return self.normalizer(raw)[..., self.parts.root]

    def raw(self, root: Tensor, local: Tensor) -> Tensor:
        """Normalized root velocities (..., 3) and local motion (..., local_dim) -> raw features (..., D)."""
        return self.normalizer.inverse(self.parts.join(root, local))

    def encode(self, local: Tensor, frames: Tensor | None = None) -> Tensor:
        """E: normalized local motion (B, T, local_dim) -> codes (B, dim, T/4), V's means; zero beyond the frames."""
        return self._posterior(local, frames)[0]

    def decode(self, codes: Tensor, count: Tensor | None = None) -> Tensor:
        """D: codes (B, dim, S), of which (B,) count -> normalized local motion (B, 4 S, local_dim)."""
        quarter = step_mask(count, codes)
        if self.config.variant == "none":
            return keep(codes, quarter).transpose(1, 2).unflatten(-1, (UNIT, self.local_dim)).flatten(1, 2)
        half = finer(quarter)
        x = self.up_first(keep(codes, quarter), half)
        return widened(keep(self.up_second(x), finer(half)).transpose(1, 2))

    def loss(self, batch: MotionBatch, progress: float, generator: torch.Generator) -> Loss:
        """L1 reconstruction plus the variant's penalty, as means over valid frames and features (steps and channels)
        in place of sums."""
        return self._loss(batch, generator)[:2]

    @torch.no_grad()
    def validate(self, batch: MotionBatch) -> dict[str, Tensor]:
        """The loss with V's means for draws, its terms and the error of the joints' local positions in millimeters."""
        loss, terms, local = self._loss(batch, None)
        decoded = self.raw(self.root(batch.motion[:, : local.shape[1]]), local)
        error = position_error(decoded, batch.motion, batch.frames // UNIT * UNIT, self.positions)
        return {"loss": loss, **terms, "position_mm": error}

    def _posterior(self, local: Tensor, frames: Tensor | None) -> tuple[Tensor, Tensor | None]:
        """Means, and V's log-variances, both (B, dim, T/4)."""
        x, mask = prepare(local, frames)
        if self.config.variant == "none":
            return x.transpose(1, 2).unflatten(1, (-1, UNIT)).flatten(2).transpose(1, 2), None
        half = coarser(mask)
        hidden, quarter = self.first(x, half), coarser(half)
        if not self.training and self.config.variant == "V":  # in use, the variances are not even computed
            means = nn.functional.conv1d(hidden, *self._mean_weights(), stride=2, padding=1)
            return widened(keep(means, quarter)), None
        codes = widened(keep(self.second(hidden), quarter))
        if self.config.variant == "A":
            return codes, None
        mean, log_variance = codes.chunk(2, 1)
        return mean, log_variance.clamp(-LARGEST, LARGEST)

    def _mean_weights(self) -> tuple[Tensor, Tensor]:
        assert self.second.bias is not None
        return self.second.weight[: self.dim], self.second.bias[: self.dim]

    def _loss(self, batch: MotionBatch, generator: torch.Generator | None) -> tuple[Tensor, dict[str, Tensor], Tensor]:
        local = self.local(batch.motion)  # (B, T, local_dim)
        codes, log_variance = self._posterior(local, batch.frames)  # (B, dim, S) both
        count = torch.div(batch.frames, UNIT, rounding_mode="floor")  # (B,) codes
        valid = length_mask(count, codes.shape[-1])  # (B, S)
        drawn = codes
        if log_variance is not None and generator is not None:
            noise = torch.randn(codes.shape, generator=generator, device=codes.device, dtype=codes.dtype)
            drawn = keep(codes + noise * (0.5 * log_variance).exp(), valid[:, None].to(codes.dtype))
        decoded = self.decode(drawn, count)  # (B, 4 S, local_dim)
        mask = length_mask(count * UNIT, decoded.shape[1])  # (B, 4 S)
        terms = {"reconstruction": masked_mean((decoded - local[:, : decoded.shape[1]]).abs(), mask)}
        loss = terms["reconstruction"]
        if self.config.variant == "V" and log_variance is not None:
            kl = 0.5 * (codes.square() + log_variance.exp() - 1 - log_variance)  # (B, dim, S)
            terms["kl"] = masked_mean(kl.transpose(1, 2), valid)
            loss = loss + self.config.kl_weight * terms["kl"]
        elif self.config.variant == "A":
            steps = codes.transpose(1, 2)  # (B, S, dim)
            terms["sparsity"] = masked_mean(steps.abs(), valid)
            terms["smoothness"] = masked_mean((steps[:, 1:] - steps[:, :-1]).abs(), valid[:, 1:])
            loss = (
                loss
                + self.config.sparsity_weight * terms["sparsity"]
                + self.config.smoothness_weight * terms["smoothness"]
            )
        return loss, {name: value.detach() for name, value in terms.items()}, decoded
