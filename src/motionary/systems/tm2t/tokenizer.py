"""Motion tokens: a convolutional autoencoder with a codebook in its middle (TM2T 3.1, Eq. 1-3, Table 3)."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from motionary.corpus.batch import MotionBatch
from motionary.corpus.context import Context
from motionary.errors import HEAVIEST, InputError, check_range
from motionary.features import UNIT
from motionary.nn.layers import length_mask, masked_mean
from motionary.nn.quantizer import KINDS, Quantizer, usage
from motionary.nn.reconstruction import distance, position_error
from motionary.nn.token_networks import TokenSettings
from motionary.systems.token_coder import TokenCoder
from motionary.systems.trainable import Loss


@dataclass(frozen=True)
class TokenizerConfig(TokenSettings):
    """Settings of the tokenizer (TM2T 3.1); conf/tokenizer.yaml explains each."""

    quantizer: str = "ema"
    freeze_encoder_from: float = 1.0
    berhu_threshold: float = 0.0
    trajectory_weight: float = 0.0

    def __post_init__(self) -> None:
        self.check("tokenizer")
        if self.quantizer not in KINDS:
            raise InputError("tokenizer.quantizer", self.quantizer, f"must be one of {', '.join(KINDS)}")
        if self.codebook_start != -1:
            check_range("tokenizer", self, ("codebook_start",), 0, 1)
        check_range("tokenizer", self, ("freeze_encoder_from",), 0, 1)
        check_range("tokenizer", self, ("trajectory_weight", "berhu_threshold"), 0, HEAVIEST)


class Tokenizer(TokenCoder):
    """Motion tokens and back (Eq. 2). Features cross its borders raw; foot contacts never reach the encoder."""

    def __init__(self, config: TokenizerConfig, context: Context):
        super().__init__(config, context)
        self.config = config

    def make_quantizer(self, config: TokenizerConfig) -> Quantizer:
        """One codebook (Eq. 1)."""
        sizes = config.codebook_size, config.code_dim
        return Quantizer(*sizes, config.quantizer, config.codebook_decay, config.restart_below)

    @torch.no_grad()
    def encode(self, raw: Tensor, frames: Tensor | None = None) -> Tensor:
        """Raw features (B, T, D), valid frames (B,) -> codes (B, T/4) long; beyond an item's frames they are 0."""
        latents = self.latents(raw, frames)
        codes = self.quantizer.nearest(latents)
        if frames is None:
            return codes
        return codes * length_mask(frames // UNIT, codes.shape[1])

    def decode(self, codes: Tensor, count: Tensor | None = None) -> Tensor:
        """Codes (B, S), valid codes (B,) -> raw features (B, 4S, D); beyond an item's codes the mean pose."""
        return self.normalizer.inverse(self.decoder(self.quantizer.look_up(codes), count))

    @torch.no_grad()
    def token_contexts(self) -> Tensor:
        """Every code decoded alone: raw segments (K, 4, D), the local contexts of Fig. 3 and 9."""
        return self.decode(torch.arange(self.quantizer.count, device=self.normalizer.mean.device)[:, None])

    def loss(self, batch: MotionBatch, progress: float, generator: torch.Generator) -> Loss:
        """Eq. 3 as means over valid frames and features, with the config's extra terms."""
        config = self.config
        warm = self.training and progress < config.codebook_start
        if self.training and not warm and config.codebook_start >= 0:
            self.start_codebook(batch, generator)
        frozen = self.training and progress >= config.freeze_encoder_from
        total, terms, _ = self._loss(batch, warm, frozen)
        return total, terms

    @torch.no_grad()
    def validate(self, batch: MotionBatch) -> dict[str, Tensor]:
        """The loss, its terms and the error of the local joint positions in millimetres."""
        total, terms, output = self._loss(batch, False, False)
        decoded = self.normalizer.inverse(output)
        error = position_error(decoded, batch.motion, batch.frames // UNIT * UNIT, self.positions)
        return {**terms, "loss": total, "position_mm": error}

    def _loss(self, batch: MotionBatch, warm: bool, frozen: bool) -> tuple[Tensor, dict[str, Tensor], Tensor]:
        config = self.config
        count = batch.frames // UNIT  # (B,) tokens
        with torch.set_grad_enabled(torch.is_grad_enabled() and not frozen):
            latents = self.latents(batch.motion, batch.frames)  # (B, S, d)
        valid = length_mask(count, latents.shape[1])  # (B, S)
        terms: dict[str, Tensor] = {}
        if warm:
            # A plain autoencoder at first: codes drawn from its latents later start near what they have to say.
            entries, embedding, commitment = latents, latents.new_zeros(()), latents.new_zeros(())
        elif frozen:
            codes = self.quantizer.nearest(latents)
            entries = self.quantizer.look_up(codes).detach()  # (B, S, d)
            embedding = commitment = latents.new_zeros(())
        else:
            entries, codes, embedding, commitment = self.quantizer(latents, valid)  # (B, S, d), (B, S), (), ()
        if not warm:
            terms["usage"], terms["perplexity"] = usage(codes[valid], config.codebook_size)
        output = self.decoder(entries, count)  # (B, 4 S, D) normalized
        target = self.normalizer(batch.motion[:, : output.shape[1]])
        # Frames of an unfinished unit have no token: nobody could decode them.
        mask = length_mask(count * UNIT, output.shape[1])  # (B, 4 S)
        terms["reconstruction"] = masked_mean(distance(output - target, config.berhu_threshold) * self.weights, mask)
        terms["commitment"] = commitment
        total = terms["reconstruction"] + embedding + config.commitment_weight * commitment
        if config.trajectory_weight:
            terms["trajectory"] = self._trajectory(output, batch.motion[:, : output.shape[1]], mask)
            total = total + config.trajectory_weight * terms["trajectory"]
        return total, {name: value.detach() for name, value in terms.items()}, output

    def _trajectory(self, output: Tensor, raw: Tensor, mask: Tensor) -> Tensor:
        """Mean distance on the ground between decoded and true roots, integrated from the first frame, in metres."""
        decoded = self.normalizer.inverse(output)
        difference = self.codec.root_path(decoded) - self.codec.root_path(raw)  # (B, T, 2)
        # Both paths start at the same place, and a square root has no finite slope at 0.
        return masked_mean((difference.square().sum(-1) + 1e-8).sqrt(), mask)
