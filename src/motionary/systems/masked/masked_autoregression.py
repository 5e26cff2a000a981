"""p(snippet codes | sentence) by a masked transformer that says of each place what it may be, and a flow that draws it.

After MAR (Li, Tian, Li, Deng, He: *Autoregressive Image Generation without Vector Quantization*, NeurIPS 2024): masked
generation as in MoMask, of codes that were never rounded to a codebook. The codes are T2M's, in their principal
components. Deviations from MAR: one transformer that reads the text word by word in place of an encoder, a decoder and
a class; a flow in place of a diffusion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor, nn

from motionary.corpus.batch import SentenceBatch, TokenBatch
from motionary.corpus.context import Context
from motionary.errors import DEEPEST, WIDEST, InputError, check_range, check_share, check_values
from motionary.nn.layers import hide_words, length_mask
from motionary.nn.snippets import SnippetDecoder, SnippetEncoder
from motionary.systems.masked.flow_head import FlowHead
from motionary.systems.masked.masked_networks import Text, TextReader, TokenReader
from motionary.systems.masked.masking import training_mask
from motionary.systems.trainable import Loss, Trainable

_NEAR = 5  # codes that are read together


class SnippetBatch(TokenBatch, SentenceBatch, Protocol):
    """Captions as words and as a language model reads them; `tokens` (B, S, components) float32 are what
    :meth:`MaskedAutoregression.encode` makes of their motions.

    Attributes:
        textless: (B,) bool, items whose text does not belong to their motion, or None.
    """

    textless: Tensor | None


@dataclass(frozen=True)
class MaskedAutoregressionConfig:
    """Settings of the generator; conf/masked_autoregression.yaml explains each.

    Attributes:
        snippet_width, snippet_dim, hide_contacts: of the autoencoder (the stage takes them from there).
    """

    snippet_width: int = 512
    snippet_dim: int = 512
    hide_contacts: bool = True
    components: int = 64
    word_dim: int = 300
    width: int = 192
    num_layers: int = 4
    num_heads: int = 6
    dim_feedforward: int = 768
    dropout: float = 0.1
    head_width: int = 320
    head_blocks: int = 3
    head_draws: int = 2
    text_dropout: float = 0.1
    word_dropout: float = 0.05
    span_share: float = 0.3
    noise: float = 0.0
    iterations: int = 10
    flow_steps: int = 16
    temperature: float = 1.0
    guidance: float = 1.5

    def __post_init__(self) -> None:
        name = "masked_autoregression"
        widths = ("snippet_width", "snippet_dim", "word_dim", "width", "num_heads", "dim_feedforward", "head_width")
        check_range(name, self, widths, 1, WIDEST)
        check_range(name, self, ("components",), 1, WIDEST)
        check_range(name, self, ("num_layers", "head_blocks"), 1, DEEPEST)
        check_range(name, self, ("head_draws", "iterations", "flow_steps"), 1, 1000)
        check_range(name, self, ("guidance", "noise"), 0, 1000)
        check_share(name, self, ("dropout", "word_dropout"))
        check_range(name, self, ("text_dropout", "span_share"), 0, 1)
        check_values(name, self, ("temperature",), lambda v: 0 < v <= 1000, "must be above 0, at most 1000")
        check_values(name, self, ("width", "head_width"), lambda v: v % 2 == 0, "must be even: sinusoids come in pairs")
        if self.width % self.num_heads:
            raise InputError(f"{name}.num_heads", self.num_heads, f"must divide width, {self.width}")
        if not self.text_dropout and self.guidance != 1:
            raise InputError(f"{name}.text_dropout", self.text_dropout, "must be above 0 unless guidance is 1")

    @property
    def told(self) -> int:
        """Components of a code, at most all."""
        return min(self.components, self.snippet_dim)


class MaskedAutoregression(Trainable):
    """A transformer over snippet codes, some of them masked, and a flow from what it says of a place to its code.

    encode(raw (B, T, D), frames (B,)) -> components (B, S, told); decode(components, count (B,)) -> raw (B, 4S,
    D).
    """

    mean: Tensor
    axes: Tensor
    scale: Tensor

    def __init__(self, config: MaskedAutoregressionConfig, context: Context):
        super().__init__()
        self.config, self.context = config, context
        sizes, seen = (config.snippet_width, config.snippet_dim), context.seen_columns(config.hide_contacts)
        self.encoder = SnippetEncoder(*sizes, seen, context.mean, context.std).requires_grad_(False)
        self.decoder = SnippetDecoder(*sizes, context.dim).requires_grad_(False)
        self.register_buffer("mean", torch.zeros(config.snippet_dim))
        self.register_buffer("axes", torch.eye(config.snippet_dim)[:, : config.told].contiguous())
        self.register_buffer("scale", torch.ones(()))
        self.text = TextReader(len(context.vocabulary), config.word_dim, config.width, config.dropout)
        # A code and its neighbors together: attention alone takes long to learn what lies beside what.
        self.input = nn.Conv1d(config.told + 1, config.width, _NEAR, padding=_NEAR // 2)
        layers = (config.num_heads, config.dim_feedforward, config.num_layers, config.dropout)
        self.reader = TokenReader(config.width, *layers)
        self.head = FlowHead(config.told, config.width, config.head_width, config.head_blocks)

    @torch.no_grad()
    def take_snippets(self, encoder: SnippetEncoder, decoder: SnippetDecoder) -> MaskedAutoregression:
        """Copies of a trained encoder and decoder."""
        self.encoder.load_state_dict(encoder.state_dict())
        self.decoder.load_state_dict(decoder.state_dict())
        return self

    @torch.no_grad()
    def take_components(self, codes: Tensor) -> float:
        """Takes the principal components of snippet codes (N, snippet_dim), scaled together to a mean square of one;
        returns the share of the variance that they keep."""
        self.mean.copy_(codes.mean(0))
        centred = (codes - self.mean).double()
        values, vectors = torch.linalg.eigh(centred.mT @ centred / len(codes))  # rising
        kept = self.config.told
        self.axes.copy_(vectors[:, -kept:].flip(1))
        self.scale.copy_(values[-kept:].mean().sqrt().clamp(min=1e-6))
        return float(values[-kept:].sum() / values.sum().clamp(min=1e-12))

    @torch.no_grad()
    def encode(self, raw: Tensor, frames: Tensor) -> Tensor:
        """Components of the snippet codes of raw features, zero beyond an item's frames."""
        codes = self.encoder(raw, frames)
        valid = length_mask(torch.div(frames, self.context.unit, rounding_mode="floor"), codes.shape[1])
        return (codes - self.mean) @ self.axes / self.scale * valid[..., None]

    def decode(self, components: Tensor, count: Tensor | None = None) -> Tensor:
        """Raw features of what :meth:`encode` gave."""
        codes = components * self.scale @ self.axes.mT + self.mean
        return self.encoder.normalizer.inverse(self.decoder(codes, count))

    def loss(self, batch: SnippetBatch, progress: float, generator: torch.Generator) -> Loss:
        """Mean square error of the flow's velocity at the masked places."""
        config, count, codes = self.config, batch.token_count, batch.tokens
        words = hide_words(batch.words, config.word_dropout, generator) if self.training else batch.words
        text = Text(words, batch.tags, batch.word_count, batch.states, batch.state_count)
        share = config.text_dropout if self.training else 0.0
        left_out = torch.rand(len(count), generator=generator, device=count.device) < share
        if batch.textless is not None:
            left_out = left_out | batch.textless
        memory = self.text(text, left_out)
        valid = length_mask(count, codes.shape[1])
        hidden = training_mask(count, codes.shape[1], config.span_share, generator)
        shown = codes
        if self.training and config.noise:
            shown = codes + config.noise * torch.randn(codes.shape, generator=generator, device=codes.device)
        told = self.reader(self.embed(shown, valid & ~hidden), count, memory, self.reader.read(memory))
        loss = self.head.loss(codes[hidden], told[hidden], config.head_draws, generator)
        return loss, {"flow": loss.detach()}

    def embed(self, codes: Tensor, known: Tensor) -> Tensor:
        """Components (B, S, told), of which those at `known` (B, S) are read -> (B, S, width)."""
        shown = torch.cat((codes, torch.ones_like(codes[..., :1])), -1) * known[..., None]
        return self.input(shown.mT).mT
