"""What tokenizers have in common: convolutions to latents and back around a quantizer of their own (TM2T 3.1)."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import torch
from torch import Tensor

from motionary.corpus.batch import MotionBatch
from motionary.corpus.context import Context
from motionary.features import UNIT, width
from motionary.nn.layers import Normalizer, length_mask
from motionary.nn.reconstruction import feature_weights
from motionary.nn.snippets import prepare
from motionary.nn.token_networks import TokenDecoder, TokenEncoder, TokenSettings
from motionary.systems.trainable import Trainable


class TokenCoder(Trainable):
    """Motion to latents, one for each unit of frames, and back; raw features cross its borders.

    Attributes:
        seen: columns of the features that the encoder reads.
        positions: those of the local joint positions.
        weights: (D,) of the features in the reconstruction.
        restart_until: share of the training up to which dead codes restart.
    """

    weights: Tensor

    def __init__(self, config: TokenSettings, context: Context):
        super().__init__()
        self.context, self.codec = context, context.make_codec()
        self.normalizer = Normalizer(context.mean, context.std)
        features = len(self.normalizer.mean)
        self.seen = context.seen_columns(config.hide_contacts)
        self.encoder = TokenEncoder(config, width(self.seen))
        self.quantizer, self.restart_until = self.make_quantizer(config), config.restart_until
        self.decoder = TokenDecoder(config, features)
        self.positions = context.columns("positions")
        weights = feature_weights(features, self.positions, config.position_weight)
        self.register_buffer("weights", weights, persistent=False)

    @abstractmethod
    def make_quantizer(self, config: Any) -> Any:
        """What turns latents to codes, by the settings of the tokenizer."""
        ...

    def latents(self, raw: Tensor, frames: Tensor | None) -> Tensor:
        """Raw features (B, T, D), valid frames (B,) -> (B, T/4, d)."""
        x, mask = prepare(self.normalizer(raw), frames)
        return self.encoder(x[:, self.seen], mask)

    @torch.no_grad()
    def start_codebook(self, batch: MotionBatch, generator: torch.Generator) -> None:
        """Draws a codebook that has not started from what the encoder says of a batch: it is used from its first step
        on, where a random one lies far from all of it and the few codes that are nearest take everything."""
        if not bool(self.quantizer.started):
            latents = self.latents(batch.motion, batch.frames)
            self.quantizer.start(latents[length_mask(batch.frames // UNIT, latents.shape[1])], generator)

    def after_step(self, step: int, progress: float, generator: torch.Generator) -> None:
        """Restart dead codes."""
        if progress < self.restart_until:
            self.quantizer.restart(generator)
