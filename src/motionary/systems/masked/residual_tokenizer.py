"""Residual motion tokens: TM2T's convolutions around a quantizer in layers (MoMask 3.1).

Deviations from MoMask: codebooks start from encoder outputs, each item draws its own number of layers (MoMask: the
batch), and a loss on feet that slide is added.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from motionary.corpus.batch import MotionBatch
from motionary.corpus.context import Context
from motionary.errors import DEEPEST, HEAVIEST, InputError, check_range
from motionary.features import UNIT, HumanML3D
from motionary.nn.finite_scalar import FiniteScalarQuantizer, check_levels
from motionary.nn.layers import length_mask, masked_mean
from motionary.nn.quantizer import usage
from motionary.nn.reconstruction import foot_speed, position_error
from motionary.nn.residual_quantizer import ResidualQuantizer
from motionary.nn.token_networks import TokenSettings
from motionary.systems.token_coder import TokenCoder
from motionary.systems.trainable import Loss


@dataclass(frozen=True)
class ResidualTokenizerConfig(TokenSettings):
    """Settings of the codec; conf/residual_tokenizer.yaml explains each."""

    commitment_weight: float = 0.02
    position_weight: float = 2.0
    num_quantizers: int = 4
    shared_codebook: bool = False
    quantizer_dropout: float = 0.2
    levels: tuple[int, ...] = ()
    smooth_below: float = 0.2
    velocity_weight: float = 0.5
    contact_weight: float = 0.1

    def __post_init__(self) -> None:
        name = "residual_tokenizer"
        self.check(name)
        check_range(name, self, ("num_quantizers",), 1, DEEPEST)
        check_range(name, self, ("codebook_start", "quantizer_dropout"), 0, 1)
        if self.levels:
            check_levels(f"{name}.levels", self.levels, self.codebook_size)
        check_range(name, self, ("smooth_below", "velocity_weight", "contact_weight"), 0, HEAVIEST)


class ResidualTokenizer(TokenCoder):
    """Motion to tokens in layers and back; features cross its borders raw, foot contacts never reach the encoder.

    A token of S is num_quantizers codes, of which the first says most; decoding takes any number of them.
    """

    def __init__(self, config: ResidualTokenizerConfig, context: Context):
        super().__init__(config, context)
        self.config = config
        if config.contact_weight and not isinstance(self.codec, HumanML3D):
            rule = f"must be 0: features of the codec {context.codec} tell no foot contacts"
            raise InputError("residual_tokenizer.contact_weight", config.contact_weight, rule)

    def make_quantizer(self, config: ResidualTokenizerConfig) -> ResidualQuantizer | FiniteScalarQuantizer:
        """A base codebook and those of what is left, or grids in their place."""
        if config.levels:
            return FiniteScalarQuantizer(config.levels, config.code_dim, config.num_quantizers)
        sizes = config.codebook_size, config.code_dim, config.num_quantizers
        return ResidualQuantizer(*sizes, config.codebook_decay, config.restart_below, config.shared_codebook)

    @torch.no_grad()
    def encode(self, raw: Tensor, frames: Tensor | None = None) -> Tensor:
        """Raw features (B, T, D), valid frames (B,) -> codes (B, T/4, layers); beyond an item's frames they are 0."""
        codes = self.quantizer.encode(self.latents(raw, frames))
        if frames is None:
            return codes
        return codes * length_mask(frames // UNIT, codes.shape[1])[..., None]

    def decode(self, codes: Tensor, count: Tensor | None = None) -> Tensor:
        """Codes (B, S, layers), or those of the base (B, S), valid ones (B,) -> raw features (B, 4S, D)."""
        codes = codes[..., None] if codes.dim() == 2 else codes
        return self.normalizer.inverse(self.decoder(self.quantizer.look_up(codes), count))

    @torch.no_grad()
    def token_contexts(self) -> Tensor:
        """Every code of the base decoded alone: raw segments (K, 4, D)."""
        return self.decode(torch.arange(self.config.codebook_size, device=self.normalizer.mean.device)[:, None])

    def loss(self, batch: MotionBatch, progress: float, generator: torch.Generator) -> Loss:
        """Smooth L1 on features and on joint velocities, sliding feet, and commitment."""
        config, layers = self.config, self.config.num_quantizers
        warm = self.training and progress < config.codebook_start and not self.quantizer.started
        if self.training and not warm:
            self.start_codebook(batch, generator)
        kept = torch.full_like(batch.frames, layers)
        if self.training and layers > 1:
            draws = torch.rand(2, len(kept), generator=generator, device=kept.device)
            fewer = 1 + (draws[1] * (layers - 1)).long()
            kept = torch.where(draws[0] < config.quantizer_dropout, fewer, kept)
        total, terms, _ = self._loss(batch, kept, warm)
        return total, terms

    @torch.no_grad()
    def validate(self, batch: MotionBatch) -> dict[str, Tensor]:
        """The loss, its terms and the error of the local joint positions in millimetres, by all layers and the base."""
        frames = batch.frames // UNIT * UNIT
        total, terms, output = self._loss(batch, torch.full_like(frames, self.config.num_quantizers), False)
        decoded = self.normalizer.inverse(output)
        base = self.decode(self.encode(batch.motion, batch.frames)[..., 0], batch.frames // UNIT)
        errors = [position_error(motion, batch.motion, frames, self.positions) for motion in (decoded, base)]
        return {**terms, "loss": total, "position_mm": errors[0], "base_position_mm": errors[1]}

    def _loss(self, batch: MotionBatch, kept: Tensor, warm: bool) -> tuple[Tensor, dict[str, Tensor], Tensor]:
        config, count = self.config, batch.frames // UNIT  # (B,) tokens
        latents = self.latents(batch.motion, batch.frames)  # (B, S, d)
        valid = length_mask(count, latents.shape[1])  # (B, S)
        terms: dict[str, Tensor] = {}
        entries, commitment = latents, latents.new_zeros(())
        if not warm:  # a plain autoencoder at first: codes drawn from its latents start near what they have to say
            entries, codes, commitment = self.quantizer(latents, valid, kept)
            terms["usage"], terms["perplexity"] = usage(codes[..., 0][valid], config.codebook_size)
        output = self.decoder(entries, count)  # (B, 4 S, D) normalized
        target = self.normalizer(batch.motion[:, : output.shape[1]])
        mask = length_mask(count * UNIT, output.shape[1])  # (B, 4 S)
        terms["reconstruction"] = masked_mean(_smooth_l1(output - target, config.smooth_below) * self.weights, mask)
        terms["commitment"] = commitment
        total = terms["reconstruction"] + config.commitment_weight * commitment
        if config.velocity_weight:
            change = (output - target)[..., self.positions].diff(dim=1)
            terms["velocity"] = masked_mean(_smooth_l1(change, config.smooth_below), mask[:, 1:])
            total = total + config.velocity_weight * terms["velocity"]
        if config.contact_weight:
            terms["sliding"] = self._sliding(self.normalizer.inverse(output), mask)
            total = total + config.contact_weight * terms["sliding"]
        return total, {name: value.detach() for name, value in terms.items()}, output

    def _sliding(self, raw: Tensor, mask: Tensor) -> Tensor:
        """Mean speed of the feet in m/s where raw features (B, T, D) say that they stand, the root integrated."""
        assert isinstance(self.codec, HumanML3D)
        stands = raw[:, :-1, self.context.columns("contacts")].detach().clamp(0, 1)
        return foot_speed(self.codec.joints(raw), self.codec.contact_joints, stands, mask, self.context.fps)


def _smooth_l1(difference: Tensor, below: float) -> Tensor:
    """Elementwise L1, squared where it is small."""
    return F.smooth_l1_loss(difference, torch.zeros_like(difference), reduction="none", beta=below)
