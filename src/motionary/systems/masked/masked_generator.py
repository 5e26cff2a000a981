"""p(residual motion tokens | sentence): base tokens by a masked transformer, the other layers one after another by a
residual transformer (MoMask 3.2, 3.3) or all together by a flow.

Deviations from MoMask: the text is read word by word (words with their classes, token states of a frozen language
model) and not as one CLIP vector; a part of the training masks whole spans, so that the same network fills gaps; both
transformers are trained together; the residual one tells codes by their entries.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import torch
import torch.nn.functional as F
from torch import Tensor

from motionary.corpus.batch import SentenceBatch, TokenBatch
from motionary.corpus.context import Context
from motionary.errors import DEEPEST, WIDEST, InputError, check_range, check_share, check_values
from motionary.nn.layers import hide_words, length_mask
from motionary.systems.masked.examples import POOL, ExampleBank, Examples
from motionary.systems.masked.flow_detail import FlowDetail
from motionary.systems.masked.masked_networks import BasePlan, Memory, ResidualDetail, Text, TextReader, TokenReader
from motionary.systems.masked.masking import corrupted, training_mask
from motionary.systems.trainable import Loss, Trainable

DETAILS = ("residual", "flow")


class MaskedBatch(TokenBatch, SentenceBatch, Protocol):
    """Captions as words and as a language model reads them, with tokens (B, S, layers) of rows `clip` of the corpus.

    Attributes:
        textless: (B,) bool, items whose text does not belong to their tokens, or None.
    """

    clip: Tensor
    textless: Tensor | None


@dataclass(frozen=True)
class MaskedGeneratorConfig:
    """Settings of the generator; conf/masked_generator.yaml explains each.

    Attributes:
        codebook_size, num_quantizers, code_dim: of the tokenizer (the stage takes them from there).
    """

    codebook_size: int
    code_dim: int
    num_quantizers: int = 1
    told_layers: int = 0
    word_dim: int = 300
    width: int = 192
    num_layers: int = 4
    detail_layers: int = 4
    num_heads: int = 6
    dim_feedforward: int = 768
    dropout: float = 0.1
    label_smoothing: float = 0.1
    text_dropout: float = 0.1
    word_dropout: float = 0.05
    span_share: float = 0.3
    random_share: float = 0.1
    kept_share: float = 0.1
    iterations: int = 10
    temperature: float = 1.0
    top_p: float = 0.9
    guidance: float = 4.0
    detail_temperature: float = 1.0
    detail_guidance: float = 2.0
    detail: str = "residual"
    flow_steps: int = 8
    examples: int = 0

    def __post_init__(self) -> None:
        name = "masked_generator"
        widths = ("codebook_size", "code_dim", "word_dim", "width", "num_heads", "dim_feedforward")
        check_range(name, self, widths, 1, WIDEST)
        check_range(name, self, ("num_quantizers", "num_layers", "detail_layers"), 1, DEEPEST)
        check_range(name, self, ("iterations", "flow_steps"), 1, 1000)
        check_range(name, self, ("told_layers",), 0, self.num_quantizers)
        check_range(name, self, ("examples",), 0, POOL)
        check_range(name, self, ("guidance", "detail_guidance", "detail_temperature"), 0, 1000)
        check_share(name, self, ("dropout", "label_smoothing", "word_dropout"))
        check_range(name, self, ("text_dropout", "span_share", "random_share", "kept_share"), 0, 1)
        check_values(name, self, ("temperature",), lambda v: 0 < v <= 1000, "must be above 0, at most 1000")
        check_values(name, self, ("top_p",), lambda v: 0 < v <= 1, "must be above 0, at most 1")
        check_values(name, self, ("width",), lambda v: v % 2 == 0, "must be even: sinusoids come in pairs")
        if self.detail not in DETAILS:
            raise InputError(f"{name}.detail", self.detail, f"must be one of {', '.join(DETAILS)}")
        if self.width % self.num_heads:
            raise InputError(f"{name}.num_heads", self.num_heads, f"must divide width, {self.width}")
        if self.random_share + self.kept_share > 1:
            raise InputError(f"{name}.random_share", self.random_share, "must be at most 1 with kept_share")
        if not self.text_dropout and {self.guidance, self.detail_guidance} != {1}:
            raise InputError(f"{name}.text_dropout", self.text_dropout, "must be above 0 unless both guidances are 1")

    @property
    def layers(self) -> int:
        """Of the codec, that are told."""
        return self.told_layers or self.num_quantizers


class MaskedGenerator(Trainable):
    """Plan and detail over the tokens of one tokenizer, whose codebooks it holds."""

    codebooks: Tensor

    def __init__(self, config: MaskedGeneratorConfig, context: Context):
        super().__init__()
        self.config, self.context = config, context
        layers, codes, width = config.num_quantizers, config.codebook_size, config.width
        sizes = (width, config.num_heads, config.dim_feedforward)
        looked_at = codes if config.examples else 0
        self.text = TextReader(len(context.vocabulary), config.word_dim, width, config.dropout, looked_at)
        self.bank = ExampleBank() if config.examples else None
        self.plan = BasePlan(codes, TokenReader(*sizes, config.num_layers, config.dropout), width)
        # One layer alone has no detail; the network is there all the same, so that every config has the same parts.
        reader = TokenReader(*sizes, config.detail_layers, config.dropout)
        self.detail: ResidualDetail | FlowDetail = (
            FlowDetail(config.code_dim, reader, width)
            if config.detail == "flow"
            else ResidualDetail(layers, codes, config.code_dim, reader, width)
        )
        self.register_buffer("codebooks", torch.zeros(layers, codes, config.code_dim))

    @torch.no_grad()
    def take_codebooks(self, codebooks: Tensor) -> MaskedGenerator:
        """The tokenizer's entries (L, K, d); base codes that lie close start alike."""
        self.codebooks.copy_(codebooks)
        told = codebooks[: self.config.layers] if isinstance(self.detail, FlowDetail) else codebooks
        self.detail.take_codebooks(told)  # a flow makes the sum of what is told
        centred = (codebooks[0] - codebooks[0].mean(0)) @ torch.randn(codebooks.shape[2], self.config.width)
        self.plan.embedding.weight[:-1] = 0.5 * centred / centred.std().clamp(min=1e-6)
        if self.text.examples is not None:
            self.text.examples.weight.copy_(self.plan.embedding.weight[:-1])
        return self

    def examples(self, states: Tensor, count: Tensor, noise: Tensor, rows: Tensor | None = None) -> Examples | None:
        """What :meth:`ExampleBank.draw` finds; None where none are looked at."""
        if self.bank is None or not len(self.bank):
            return None
        return self.bank.draw(self.config.examples, states, count, noise, rows)

    def loss(self, batch: MaskedBatch, progress: float, generator: torch.Generator) -> Loss:
        """Cross-entropy of the masked base codes, and of one random further layer in each item."""
        config, count = self.config, batch.token_count
        valid = length_mask(count, batch.tokens.shape[1])
        memory = self.text(self._read(batch, generator), self._left_out(batch, generator))
        base = batch.tokens[..., 0]
        hidden = training_mask(count, base.shape[1], config.span_share, generator)
        shares = (config.random_share, config.kept_share)
        shown = corrupted(base, hidden, config.codebook_size, *shares, generator)
        logits = self.plan(shown, count, memory, self.plan.reader.read(memory))[hidden]
        smoothing = config.label_smoothing if self.training else 0.0
        plan = F.cross_entropy(logits, base[hidden], label_smoothing=smoothing)
        terms = {"plan_nll": plan, "plan_top1": (logits.argmax(-1) == base[hidden]).float().mean()}
        total = plan
        if config.layers > 1:
            if isinstance(self.detail, FlowDetail):
                terms["detail_flow"] = self.detail.loss(
                    self.entries(batch.tokens[..., : config.layers]), valid, memory, generator
                )
                total = plan + terms["detail_flow"]
            else:
                terms |= self._detail_terms(self.detail, batch.tokens, count, valid, memory, generator)
                total = plan + terms["detail_nll"]
        return total, {name: value.detach() for name, value in terms.items()}

    def entries(self, codes: Tensor) -> Tensor:
        """(B, S, L') codes of the first layers -> (B, S, L', d) their entries."""
        return torch.stack([F.embedding(codes[..., i], self.codebooks[i]) for i in range(codes.shape[-1])], 2)

    def _detail_terms(
        self,
        detail: ResidualDetail,
        codes: Tensor,
        count: Tensor,
        valid: Tensor,
        memory: Memory,
        generator: torch.Generator,
    ) -> dict[str, Tensor]:
        """The loss of the layer that each item draws, given the true codes of those before."""
        level = torch.randint(1, self.config.layers, (len(codes),), generator=generator, device=codes.device)
        before = torch.arange(codes.shape[-1], device=codes.device) < level[:, None, None]  # (B, 1, L)
        so_far = (self.entries(codes) * before[..., None]).sum(2)  # (B, S, d)
        told = detail(so_far, level, count, memory, detail.reader.read(memory))
        losses, right, smoothing = [], [], self.config.label_smoothing if self.training else 0.0
        for layer in range(1, self.config.layers):
            chosen = valid & (level == layer)[:, None]
            logits, target = detail.logits(told[chosen], layer, self.codebooks[layer]), codes[..., layer][chosen]
            losses.append(F.cross_entropy(logits, target, label_smoothing=smoothing, reduction="sum"))
            right.append((logits.argmax(-1) == target).sum())
        total = valid.sum()
        return {"detail_nll": torch.stack(losses).sum() / total, "detail_top1": torch.stack(right).sum() / total}

    def _read(self, batch: MaskedBatch, generator: torch.Generator) -> Text:
        words = hide_words(batch.words, self.config.word_dropout, generator) if self.training else batch.words
        states = (batch.states, batch.state_count)
        examples = None
        if self.bank:  # there, and filled
            noise = torch.rand(len(words), POOL, generator=generator, device=words.device)
            examples = self.examples(*states, noise, batch.clip)
        return Text(words, batch.tags, batch.word_count, *states, examples)

    def _left_out(self, batch: MaskedBatch, generator: torch.Generator) -> Tensor:
        """(B,) whose text is left out, by chance or since it tells of something else."""
        share, device = self.config.text_dropout if self.training else 0.0, self.codebooks.device
        left_out = torch.rand(len(batch.token_count), generator=generator, device=device) < share
        return left_out if batch.textless is None else left_out | batch.textless
