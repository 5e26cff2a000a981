"""Motion snippet codes: a convolutional autoencoder, four frames to a code (thesis 4.2.1, Eq. 4.1-4.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from motionary.corpus.batch import MotionBatch
from motionary.corpus.context import Context
from motionary.errors import HEAVIEST, WIDEST, check_range
from motionary.features import UNIT
from motionary.nn.layers import length_mask, masked_mean
from motionary.nn.reconstruction import distance, feature_weights, position_error
from motionary.nn.snippets import SnippetDecoder, SnippetEncoder
from motionary.systems.trainable import Loss, Trainable


@dataclass(frozen=True)
class AutoencoderConfig:
    """Settings of the snippet codes (thesis 4.2.1); conf/autoencoder.yaml explains each."""

    width: int = 512
    code_dim: int = 512
    sparsity_weight: float = 0.001
    smoothness_weight: float = 0.001
    hide_contacts: bool = True
    position_weight: float = 0.0
    berhu_threshold: float = 0.0

    def __post_init__(self) -> None:
        check_range("autoencoder", self, ("width", "code_dim"), 1, WIDEST)
        weights = ("sparsity_weight", "smoothness_weight", "position_weight", "berhu_threshold")
        check_range("autoencoder", self, weights, 0, HEAVIEST)

    def as_upstream(self) -> dict[str, Any]:
        """What this decides of the config of a system that reads the codes."""
        return {"snippet_width": self.width, "snippet_dim": self.code_dim, "hide_contacts": self.hide_contacts}


class Autoencoder(Trainable):
    """Snippet codes and back (Eq. 4.1). Features cross its borders raw.

    encode(raw (B, T, D), frames (B,)) -> codes (B, T/4, code_dim); decode(codes, count (B,)) -> raw (B, 4S, D).
    """

    weights: Tensor

    def __init__(self, config: AutoencoderConfig, context: Context):
        super().__init__()
        self.config, self.context = config, context
        seen = context.seen_columns(config.hide_contacts)
        self.encoder = SnippetEncoder(config.width, config.code_dim, seen, context.mean, context.std)
        features = len(self.encoder.normalizer.mean)
        self.decoder = SnippetDecoder(config.width, config.code_dim, features)
        self.positions = context.columns("positions")
        weights = feature_weights(features, self.positions, config.position_weight)
        self.register_buffer("weights", weights, persistent=False)

    def encode(self, raw: Tensor, frames: Tensor | None = None) -> Tensor:
        """Snippet codes of raw features, zero beyond an item's frames."""
        return self.encoder(raw, frames)

    def decode(self, codes: Tensor, count: Tensor | None = None) -> Tensor:
        """Raw features of snippet codes."""
        return self.encoder.normalizer.inverse(self.decoder(codes, count))

    def loss(self, batch: MotionBatch, progress: float, generator: torch.Generator) -> Loss:
        """Eq. 4.2, as means over valid frames and features (codes and dimensions) in place of sums."""
        return self._loss(batch)[:2]

    def _loss(self, batch: MotionBatch) -> tuple[Tensor, dict[str, Tensor], Tensor]:
        codes = self.encode(batch.motion, batch.frames)  # (B, S, code_dim)
        count = torch.div(batch.frames, UNIT, rounding_mode="floor")  # (B,) codes
        output = self.decoder(codes, count)  # (B, 4 S, D) normalized
        target = self.encoder.normalizer(batch.motion[:, : output.shape[1]])
        mask = length_mask(count * UNIT, output.shape[1])  # (B, 4 S)
        terms = {
            "reconstruction": masked_mean(distance(output - target, self.config.berhu_threshold) * self.weights, mask)
        }
        valid = length_mask(count, codes.shape[1])  # (B, S)
        terms["sparsity"] = masked_mean(codes.abs(), valid)
        # A step is valid where the code that it leads to is: the one to the zeros of the padding is none.
        terms["smoothness"] = masked_mean((codes[:, 1:] - codes[:, :-1]).abs(), valid[:, 1:])
        loss = (
            terms["reconstruction"]
            + self.config.sparsity_weight * terms["sparsity"]
            + self.config.smoothness_weight * terms["smoothness"]
        )
        return loss, {name: value.detach() for name, value in terms.items()}, output

    @torch.no_grad()
    def validate(self, batch: MotionBatch) -> dict[str, Tensor]:
        """The loss, its terms and the position error in millimetres."""
        loss, terms, output = self._loss(batch)
        decoded = self.encoder.normalizer.inverse(output)
        error = position_error(decoded, batch.motion, batch.frames // UNIT * UNIT, self.positions)
        return {"loss": loss, **terms, "position_mm": error}
