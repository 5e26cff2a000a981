"""Text to motion by a temporal VAE on snippet codes (thesis 4.2.3, Eq. 4.3-4.6), lengths from text2length."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from motionary.corpus.batch import PairBatch
from motionary.corpus.context import Context
from motionary.errors import HEAVIEST, MOST, WIDEST, check_range, check_share, check_values
from motionary.nn.gaussian import divergence
from motionary.nn.layers import hide_words, length_mask, masked_mean
from motionary.nn.snippets import SnippetDecoder, SnippetEncoder
from motionary.systems.t2m.curriculum import Curriculum
from motionary.systems.t2m.temporal_vae import TemporalVAE, Unroll
from motionary.systems.trainable import Loss, Trainable


@dataclass(frozen=True)
class Text2MotionConfig:
    """Settings of the temporal VAE, here the thesis's (4.4); conf/text2motion.yaml explains each.

    Attributes:
        snippet_width, snippet_dim, hide_contacts: of the autoencoder (the stage takes them from there).
    """

    word_dim: int = 300
    text_width: int = 512
    width: int = 1024
    attention_width: int = 512
    latent: int = 128
    snippets: bool = True
    attention: bool = True
    tags: bool = True
    positions: bool = True
    dropout: float = 0.0
    word_dropout: float = 0.0
    motion_weight: float = 1.0
    kl_weight: float = 0.01
    teacher_forcing: float = 0.4
    decoder_rate: float = 0.1
    curriculum_start: int = 8
    curriculum_add: int = 1
    curriculum_patience: int = 5
    curriculum_share: float = 0.0
    temperature: float = 1.0
    snippet_width: int = 512
    snippet_dim: int = 512
    hide_contacts: bool = True

    def __post_init__(self) -> None:
        check_range("text2motion", self, ("word_dim", "text_width", "width", "attention_width", "latent"), 1, WIDEST)
        check_share("text2motion", self, ("dropout",))
        shares = ("word_dropout", "teacher_forcing", "curriculum_share")
        check_values("text2motion", self, shares, lambda v: 0 <= v <= 1, "must be in 0..1")
        steps = ("curriculum_start", "curriculum_add", "curriculum_patience")
        check_range("text2motion", self, steps, 1, MOST)
        weights = ("motion_weight", "kl_weight", "decoder_rate", "temperature")
        check_range("text2motion", self, weights, 0, HEAVIEST)


class Text2Motion(Trainable):
    """p(motion | sentence, length): the temporal VAE between a frozen snippet encoder and a fine-tuned decoder.

    encode(raw (B, T, D), frames (B,)) -> codes (B, S, c); decode(codes, count (B,)) -> raw (B, T', D). A code stands
    for `stride` frames: four, or one without snippet codes.
    """

    first: Tensor

    def __init__(self, config: Text2MotionConfig, context: Context):
        super().__init__()
        self.config, self.context = config, context
        sizes, seen = (config.snippet_width, config.snippet_dim), context.seen_columns(config.hide_contacts)
        self.encoder = SnippetEncoder(*sizes, seen, context.mean, context.std).requires_grad_(False)
        self.decoder = SnippetDecoder(*sizes, context.dim) if config.snippets else None
        self.stride = context.unit if config.snippets else 1
        code = config.snippet_dim if config.snippets else context.dim
        self.net = TemporalVAE(
            len(context.vocabulary), config.word_dim, config.text_width, code, config.width,
            config.attention_width if config.attention else 0, config.latent, config.tags, config.positions,
            config.dropout,
        )  # fmt: skip
        self.curriculum = Curriculum(
            config.curriculum_start, config.curriculum_add, context.max_tokens, config.curriculum_patience
        )
        self.register_buffer("first", torch.zeros(code))

    @torch.no_grad()
    def take_snippets(self, encoder: SnippetEncoder, decoder: SnippetDecoder) -> Text2Motion:
        """Copy the trained encoder and decoder, and set the code that is read first: that of the mean pose."""
        self.encoder.load_state_dict(encoder.state_dict())
        if self.decoder is not None:
            self.decoder.load_state_dict(decoder.state_dict())
            pose = self.encoder.normalizer.mean.expand(1, self.context.unit, -1)
            self.first.copy_(self.encoder(pose)[0, 0])
        return self

    def parameter_groups(self, learning_rate: float) -> list[dict[str, Any]]:
        """The decoder at its own rate, all else at the full one."""
        groups: list[dict[str, Any]] = [{"params": list(self.net.parameters()), "lr": learning_rate}]
        if self.decoder is not None and self.config.decoder_rate:
            rate = learning_rate * self.config.decoder_rate
            groups.append({"params": list(self.decoder.parameters()), "lr": rate})
        return groups

    @torch.no_grad()
    def encode(self, raw: Tensor, frames: Tensor) -> Tensor:
        """Snippet codes of raw features (without snippets: the normalized features themselves)."""
        if self.decoder is None:
            return self.encoder.normalizer(raw)
        return self.encoder(raw, frames)

    def decode(self, codes: Tensor, count: Tensor | None = None) -> Tensor:
        """Raw features of what :meth:`encode` gave."""
        return self.encoder.normalizer.inverse(codes if self.decoder is None else self.decoder(codes, count))

    def loss(self, batch: PairBatch, progress: float, generator: torch.Generator) -> Loss:
        """Eq. 4.6 over the codes of the curriculum's stage, one teacher-forcing coin per sequence."""
        if self.config.curriculum_share:
            self.curriculum.at_least(progress / self.config.curriculum_share)
        coins = torch.rand(len(batch.motion), generator=generator, device=batch.motion.device)
        words = hide_words(batch.words, self.config.word_dropout if self.training else 0.0, generator)
        return self._loss(batch, words, coins < self.config.teacher_forcing, generator)

    @torch.no_grad()
    def validate(self, batch: PairBatch) -> dict[str, Tensor]:
        """Eq. 4.6 where every sequence reads its own codes, with fixed noise; "reconstruction" moves the curriculum.

        The losses of different stages cannot be compared: train with patience=0.
        """
        noise = torch.Generator(batch.motion.device).manual_seed(0)
        loss, logs = self._loss(batch, batch.words, torch.zeros_like(batch.frames, dtype=torch.bool), noise)
        return {"loss": loss, **logs}

    def after_validation(self, values: Mapping[str, float]) -> None:
        """Moves the curriculum on."""
        self.curriculum.observe(values["reconstruction"])

    def _loss(
        self, batch: PairBatch, words: Tensor, forced: Tensor, generator: torch.Generator
    ) -> tuple[Tensor, dict[str, Tensor]]:
        length = torch.div(batch.frames, self.stride, rounding_mode="floor")  # (B,) codes of the whole motion
        stage = self.curriculum.length * (self.context.unit // self.stride)
        count = length.clamp(max=stage)  # (B,) codes that are learned; the time to arrival stays the whole motion's
        targets = self.encode(batch.motion, batch.frames)[:, : int(count.max())]  # (B, S, c)
        shape = (*targets.shape[:2], self.config.latent)
        noise = torch.randn(shape, generator=generator, device=targets.device)  # (B, S, z)
        sentence, hidden = self.net.start(words, batch.tags, batch.word_count)
        made = self.net.unroll(sentence, hidden, targets, self.first, length, forced, noise)
        terms = self._terms(made, targets, count, batch.motion)
        loss = torch.stack([weight * value for weight, value in terms.values()]).sum()
        logs = {name: value.detach() for name, (_, value) in terms.items()}
        # Without the divergence, which may rise while motions get better: it must not move the curriculum on.
        parts = [weight * value for name, (weight, value) in terms.items() if name != "kl"]
        logs["reconstruction"] = torch.stack(parts).sum().detach()
        return loss, {**logs, "codes": self.curriculum.codes.float()}

    def _terms(self, made: Unroll, targets: Tensor, count: Tensor, motion: Tensor) -> dict[str, tuple[float, Tensor]]:
        """The three terms of Eq. 4.6 with their weights. Without snippet codes the first two are the same."""
        valid = length_mask(count, targets.shape[1])  # (B, S)
        terms = {"code": (1.0, masked_mean((made.codes - targets).abs(), valid))}
        if self.decoder is not None and self.config.motion_weight:
            normalized = self.decoder(made.codes, count)  # (B, 4 S, D)
            true = self.encoder.normalizer(motion[:, : normalized.shape[1]])
            mask = length_mask(count * self.stride, normalized.shape[1])  # (B, 4 S)
            terms["motion"] = (self.config.motion_weight, masked_mean((normalized - true).abs(), mask))
        terms["kl"] = (self.config.kl_weight, masked_mean(divergence(made.posterior, made.prior), valid))
        return terms
