"""Contrastive extractors of text and motion features, the yardstick of all evaluation (TM2T Eq. 8, appendix C)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from motionary.corpus.batch import PairBatch, SentenceBatch
from motionary.corpus.context import Context
from motionary.errors import HEAVIEST, WIDEST, InputError, check_range, check_share, check_values
from motionary.features import UNIT
from motionary.language import STATE_DIM
from motionary.nn.layers import TextEncoder
from motionary.nn.precision import widened
from motionary.nn.recurrent import BiGRU
from motionary.nn.snippets import SnippetEncoder
from motionary.systems.judges.contrastive import first_share, infonce_loss, margin_loss
from motionary.systems.trainable import Loss, Trainable

LOSSES = ("infonce", "margin")
TEXTS = ("words", "sentence")


@dataclass(frozen=True)
class EvaluatorConfig:
    """Settings of the evaluator (TM2T Eq. 8); conf/evaluator.yaml explains each.

    Attributes:
        snippet_width, snippet_dim, hide_contacts: of the autoencoder whose frozen codes the motion branch reads.
    """

    text_width: int = 256
    motion_width: int = 384
    dim: int = 512
    word_dim: int = 300
    tags: bool = True
    dropout: float = 0.1
    objective: str = "infonce"
    margin: float = 10.0
    temperature: float = 0.1
    radius: float = 10.0
    snippet_width: int = 512
    snippet_dim: int = 512
    hide_contacts: bool = True
    text: str = "words"

    def __post_init__(self) -> None:
        if self.objective not in LOSSES:
            raise InputError("evaluator.objective", self.objective, f"must be one of {', '.join(LOSSES)}")
        if self.text not in TEXTS:
            raise InputError("evaluator.text", self.text, f"must be one of {', '.join(TEXTS)}")
        check_range("evaluator", self, ("text_width", "motion_width", "dim", "word_dim"), 1, WIDEST)
        check_share("evaluator", self, ("dropout",))
        scales = ("margin", "temperature", "radius")
        check_values("evaluator", self, scales, lambda v: 0 < v <= HEAVIEST, f"must be above 0, at most {HEAVIEST}")


class Evaluator(Trainable):
    """Text and motion to vectors that are near where they match.

    embed_text(ids (B, N), tags (B, N) | None, count (B,)) -> (B, dim) with text "words",
    embed_states(states (B, N, d), count (B,)) -> (B, dim) with "sentence";
    embed_motion(raw (B, T, D), frames (B,)) -> (B, dim). Neither depends on padding or on the rest of the batch.
    """

    def __init__(self, config: EvaluatorConfig, context: Context):
        super().__init__()
        self.config, self.context = config, context
        sizes, seen = (config.snippet_width, config.snippet_dim), context.seen_columns(config.hide_contacts)
        self.snippets = SnippetEncoder(*sizes, seen, context.mean, context.std).requires_grad_(False)
        self.text = self._text_encoder()
        # The papers put a linear layer before the motion GRU; the GRU's own input product makes it redundant.
        self.motion = BiGRU(config.snippet_dim, config.motion_width)
        self.dropout = nn.Dropout(config.dropout)
        self.text_head = _head(2 * config.text_width, config.text_width, config.dim)
        self.motion_head = _head(2 * config.motion_width, config.motion_width, config.dim)

    def _text_encoder(self) -> nn.Module:
        config = self.config
        if config.text == "sentence":
            return StateEncoder(STATE_DIM, config.text_width, config.dropout)
        return TextEncoder(
            len(self.context.vocabulary), config.word_dim, config.text_width, config.tags, config.dropout
        )

    @property
    def reads_states(self) -> bool:
        """Whether sentences come as token states of the frozen language model."""
        return self.config.text == "sentence"

    def take_snippets(self, encoder: SnippetEncoder) -> Evaluator:
        """Copy the trained encoder; it stays frozen and is saved along, so that an evaluator stands alone."""
        self.snippets.load_state_dict(encoder.state_dict())
        return self

    def embed_text(self, ids: Tensor, tags: Tensor | None, count: Tensor) -> Tensor:
        """Features of sentences of words."""
        sentence = cast(TextEncoder, self.text).sentence(ids, tags if self.config.tags else None, count)
        return self._place(self.text_head(self.dropout(sentence)))

    def embed_states(self, states: Tensor, count: Tensor) -> Tensor:
        """Features of sentences as token states."""
        return self._place(self.text_head(self.dropout(self.text(states, count))))

    def embed_motion(self, raw: Tensor, frames: Tensor) -> Tensor:
        """Features of motions of at least one unit; shorter ones are an InputError."""
        if int(frames.min()) < UNIT:
            raise InputError("frames", int(frames.min()), f"a motion needs at least {UNIT} frames")
        with torch.no_grad():
            codes = self.snippets(raw, frames)
        state = self.motion.last(self.dropout(codes), torch.div(frames, UNIT, rounding_mode="floor"))
        return self._place(self.motion_head(self.dropout(state)))

    def loss(self, batch: PairBatch, progress: float, generator: torch.Generator) -> Loss:
        """Eq. 8 or InfoNCE, by the config; logs the share of pairs that stand first in the batch."""
        text = self._texts(batch)  # (B, dim)
        motion = self.embed_motion(batch.motion, batch.frames)  # (B, dim)
        # Captions repeat within a batch: a motion that another's words describe as well is no mismatch.
        same = batch.text_key[:, None] == batch.text_key[None]  # (B, B)
        if self.config.objective == "margin":
            shift = int(torch.randint(1, max(2, len(text)), (), generator=generator, device=generator.device))
            loss = margin_loss(text, motion, same, shift, self.config.margin)
        else:
            loss = infonce_loss(text, motion, same, self.config.temperature)
        return loss, {"top1": first_share(text, motion, same)}

    def _texts(self, batch: PairBatch) -> Tensor:
        if self.reads_states:
            states = cast(SentenceBatch, batch)
            return self.embed_states(states.states, states.state_count)
        return self.embed_text(batch.words, batch.tags, batch.word_count)

    def _place(self, x: Tensor) -> Tensor:
        x = widened(x)
        return x if self.config.objective == "margin" else self.config.radius * F.normalize(x, dim=-1)


class StateEncoder(nn.Module):
    """A linear layer and a bidirectional GRU over token states (B, N, d), count (B,) -> (B, 2 hidden)."""

    def __init__(self, inputs: int, hidden: int, dropout: float):
        super().__init__()
        self.input = nn.Linear(inputs, hidden)
        self.dropout = nn.Dropout(dropout)
        self.recurrent = BiGRU(hidden, hidden)

    def forward(self, states: Tensor, count: Tensor) -> Tensor:
        """The last states of both directions."""
        return self.recurrent.last(self.dropout(self.input(states)), count)


def _head(inputs: int, hidden: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(inputs, hidden), nn.LayerNorm(hidden), nn.LeakyReLU(0.2), nn.Linear(hidden, outputs))
