"""p(snippet codes | sentence) by a masked transformer that says of each place what it may be, and a flow that draws it.

After MAR (Li, Tian, Li, Deng, He: *Autoregressive Image Generation without Vector Quantization*, NeurIPS 2024): masked
generation as in MoMask, of codes that were never rounded to a codebook. The codes are T2M's, in their principal
components. Deviations from MAR: one transformer that reads the text word by word in place of an encoder, a decoder and
a class; a flow in place of a diffusion. The decoder goes on learning beside them: T2M's (Eq. 4.1) alone shakes, and its
feet slide.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor, nn

from motionary.corpus.batch import Batch, MotionBatch, SentenceBatch, TokenBatch
from motionary.corpus.context import Context
from motionary.errors import DEEPEST, HEAVIEST, WIDEST, InputError, check_range, check_share, check_values
from motionary.features import HumanML3D
from motionary.nn.layers import hide_words, length_mask, masked_mean
from motionary.nn.reconstruction import foot_speed
from motionary.nn.snippets import SnippetDecoder, SnippetEncoder
from motionary.systems.masked.flow_head import FlowHead
from motionary.systems.masked.masked_networks import Text, TextReader, TokenReader
from motionary.systems.masked.masking import training_mask
from motionary.systems.trainable import Loss, Trainable

_NEAR = 5  # codes that are read together


class SnippetBatch(TokenBatch, SentenceBatch, MotionBatch, Protocol):
    """Captions as words and as a language model reads them; `tokens` (B, S, components) float32 are what
    :meth:`MaskedAutoregression.encode` makes of their motions. `motion` is read by the decoder alone.

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
    decoder_items: int = 0
    decoder_noise: float = 0.3
    velocity_weight: float = 0.1
    acceleration_weight: float = 0.1
    contact_weight: float = 0.2
    iterations: int = 8
    flow_steps: int = 8
    temperature: float = 1.0
    guidance: float = 1.5

    def __post_init__(self) -> None:
        name = "masked_autoregression"
        widths = ("snippet_width", "snippet_dim", "word_dim", "width", "num_heads", "dim_feedforward", "head_width")
        check_range(name, self, widths, 1, WIDEST)
        check_range(name, self, ("components",), 1, WIDEST)
        check_range(name, self, ("num_layers", "head_blocks"), 1, DEEPEST)
        check_range(name, self, ("head_draws", "iterations", "flow_steps"), 1, 1000)
        check_range(name, self, ("guidance", "noise", "decoder_items", "decoder_noise"), 0, 1000)
        check_range(name, self, ("velocity_weight", "acceleration_weight", "contact_weight"), 0, HEAVIEST)
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
        self.decoder = SnippetDecoder(*sizes, context.dim).requires_grad_(config.decoder_items > 0)
        codec = context.make_codec()
        if config.decoder_items and not isinstance(codec, HumanML3D):
            rule = f"must be 0: features of the codec {context.codec} tell no foot contacts"
            raise InputError("masked_autoregression.decoder_items", config.decoder_items, rule)
        self.codec = codec
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
        return self.encoder.normalizer.inverse(self.decoder(self._codes(components), count))

    def _codes(self, components: Tensor) -> Tensor:
        """Snippet codes of their components."""
        return components * self.scale @ self.axes.mT + self.mean

    def loss(self, batch: SnippetBatch, progress: float, generator: torch.Generator) -> Loss:
        """Mean square error of the flow's velocity at the masked places, and what the decoder learns from."""
        flow = self._flow_loss(batch, generator)
        if not self.config.decoder_items:
            return flow, {"flow": flow.detach()}
        decoding, terms = self._decoding_loss(batch, generator)
        return flow + decoding, {"flow": flow.detach(), **terms}

    @torch.no_grad()
    def validate(self, batch: Batch) -> dict[str, Tensor]:
        """The loss is the flow's alone: the decoder, which takes no part in it, does not overfit first."""
        values = super().validate(batch)
        return {**values, "loss": values["flow"]}

    def _flow_loss(self, batch: SnippetBatch, generator: torch.Generator) -> Tensor:
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
        return self.head.loss(codes[hidden], told[hidden], config.head_draws, generator)

    def _decoding_loss(self, batch: MotionBatch, generator: torch.Generator) -> Loss:
        """From noised codes back to features (L1, as Eq. 4.2), and with the root integrated to the joints' speeds,
        their changes, and feet that stand where the real ones do."""
        config, unit, fps = self.config, self.context.unit, self.context.fps
        assert isinstance(self.codec, HumanML3D)
        # At random: batches are sorted by length, and the first would always be the shortest.
        rows = torch.randperm(len(batch.frames), generator=generator, device=batch.frames.device)
        rows = rows[: config.decoder_items]
        raw, frames = batch.motion[rows], batch.frames[rows]
        raw = raw[:, : int(frames.max())]
        codes, count = self.encode(raw, frames), torch.div(frames, unit, rounding_mode="floor")
        spread = torch.rand(len(codes), 1, 1, generator=generator, device=codes.device)
        noise = torch.randn(codes.shape, generator=generator, device=codes.device)
        output = self.decoder(self._codes(codes + config.decoder_noise * spread * noise), count)  # (B, 4 S, D)
        raw, mask = raw[:, : output.shape[1]], length_mask(count * unit, output.shape[1])
        made, real = self.codec.joints(self.encoder.normalizer.inverse(output)), self.codec.joints(raw)
        off = (made - real).flatten(2)  # (B, 4 S, 3 J) metres
        stands = raw[:, :-1, self.context.columns("contacts")].clamp(0, 1)
        terms = {
            "reconstruction": masked_mean((output - self.encoder.normalizer(raw)).abs(), mask),
            "velocity": masked_mean(off.diff(dim=1).abs(), mask[:, 1:]) * fps,
            "acceleration": masked_mean(off.diff(n=2, dim=1).abs(), mask[:, 2:]) * fps,
            "sliding": foot_speed(made, self.codec.contact_joints, stands, mask, fps),
        }
        loss = (
            terms["reconstruction"]
            + config.velocity_weight * terms["velocity"]
            + config.acceleration_weight * terms["acceleration"]
            + config.contact_weight * terms["sliding"]
        )
        return loss, {name: value.detach() for name, value in terms.items()}

    def embed(self, codes: Tensor, known: Tensor) -> Tensor:
        """Components (B, S, told), of which those at `known` (B, S) are read -> (B, S, width)."""
        shown = torch.cat((codes, torch.ones_like(codes[..., :1])), -1) * known[..., None]
        return self.input(shown.mT).mT
