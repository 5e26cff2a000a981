"""Text to motion tokens: the attentive GRU (TM2T 3.3, Eq. 5-6) and the Transformer baseline "ours baseline (T)"."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from motionary.corpus.batch import TokenBatch
from motionary.corpus.context import Context
from motionary.errors import DEEPEST, MOST, WIDEST, InputError, check_range, check_share, check_values
from motionary.nn.layers import WordEmbedding, hide_words, length_mask
from motionary.nn.transformer import Cache, TokenTransformer
from motionary.systems.tm2t.token_gru import TokenGRU
from motionary.systems.trainable import Loss, Trainable


@dataclass(frozen=True)
class Text2TokenConfig:
    """Settings of the generator, here the paper's (appendix B, Table 3); conf/text2token.yaml explains each.

    Attributes:
        codebook_size: of the tokenizer (the stage takes it from there).
    """

    section: ClassVar[str] = "text2token"  # of the configuration, for messages

    codebook_size: int
    tokenizer: str = "tokenizer"
    architecture: str = "gru"
    word_dim: int = 300
    text_width: int = 512
    width: int = 1024
    num_layers: int = 3
    dim_feedforward: int = 2048
    num_heads: int = 8
    tags: bool = False
    positions: bool = True
    dropout: float = 0.0
    label_smoothing: float = 0.0
    teacher_forcing_start: float = 0.4
    teacher_forcing_end: float = 0.4
    token_dropout: float = 0.0
    word_dropout: float = 0.0
    text_dropout: float = 0.0
    max_tokens: int = 49
    temperature: float = 1.0
    top_k: int = 0
    top_p: float = 1.0
    guidance: float = 1.0

    def __post_init__(self):
        shares = ("teacher_forcing_start", "teacher_forcing_end", "token_dropout", "word_dropout", "text_dropout")
        check_values(self.section, self, shares, lambda v: 0 <= v <= 1, "must be a probability, 0 to 1")
        check_share(self.section, self, ("dropout", "label_smoothing"))
        check_range(self.section, self, ("word_dim", "text_width", "width", "dim_feedforward", "num_heads"), 1, WIDEST)
        check_range(self.section, self, ("num_layers",), 1, DEEPEST)
        check_range(self.section, self, ("max_tokens",), 1, MOST)
        check_range(self.section, self, ("top_k", "guidance"), 0, WIDEST)
        check_values(self.section, self, ("temperature",), lambda v: 0 < v <= 1000, "must be above 0, at most 1000")
        check_values(self.section, self, ("top_p",), lambda v: 0 < v <= 1, "must be above 0, at most 1")
        if self.architecture not in ("gru", "transformer"):
            raise InputError(f"{self.section}.architecture", self.architecture, "must be gru or transformer")
        if self.architecture == "transformer" and self.width % self.num_heads:
            raise InputError(f"{self.section}.width", self.width, f"must be divisible by num_heads={self.num_heads}")
        if self.guidance != 1 and not self.text_dropout:
            raise InputError(f"{self.section}.guidance", self.guidance, "must be 1 unless text_dropout is above 0")


class TransformerTokens(nn.Module):
    """The Transformer in the GRU's place, with the same methods; it is always teacher-forced, as in the paper."""

    def __init__(self, config: Text2TokenConfig, words: int):
        super().__init__()
        self.words = WordEmbedding(words, config.width, config.tags)
        self.tokens = nn.Embedding(config.codebook_size + 3, config.width)
        nn.init.normal_(self.tokens.weight, std=config.width**-0.5)
        self.body = TokenTransformer(
            config.width, config.num_heads, config.dim_feedforward, config.num_layers, config.num_layers, config.dropout
        )
        self.scale = config.width**0.5

    def start(self, words: Tensor, tags: Tensor | None, count: Tensor) -> tuple[Tensor, Tensor]:
        """See :class:`TokenGRU`; here the state is the memory and its mask until the first step."""
        mask = length_mask(count, words.shape[1])
        return self.body.encode(self.words(words, tags) * self.scale, mask), mask

    def unroll(self, state: tuple[Tensor, Tensor], tokens: Tensor, free=None, generator=None) -> Tensor:
        """All positions at once."""
        return self.body.decode(self.tokens(tokens) * self.scale, *state)

    def logits(self, hidden: Tensor) -> Tensor:
        """Embedding and projection share their weights."""
        return F.linear(hidden, self.tokens.weight)

    def step(self, state: Cache | tuple[Tensor, Tensor], tokens: Tensor) -> tuple[Tensor, Cache]:
        """See :class:`motionary.nn.decoding.Decoder`."""
        cache = state if isinstance(state, Cache) else self.body.start(*state)
        hidden, cache = self.body.step(self.tokens(tokens) * self.scale, cache)
        return self.logits(hidden), cache

    def reorder(self, state: Cache | tuple[Tensor, Tensor], index: Tensor) -> Cache:
        """See :class:`motionary.nn.decoding.Decoder`."""
        cache = state if isinstance(state, Cache) else self.body.start(*state)
        return cache.reorder(index)


class Text2Token(Trainable):
    """p(motion tokens | sentence). Tokens K, K + 1 and K + 2 are start, end and padding."""

    def __init__(self, config: Text2TokenConfig, context: Context):
        super().__init__()
        self.config, self.context = config, context
        self.start_token, self.end_token, self.pad_token = (
            config.codebook_size,
            config.codebook_size + 1,
            config.codebook_size + 2,
        )
        words = len(context.vocabulary)
        if config.architecture == "transformer":
            self.net: TokenGRU | TransformerTokens = TransformerTokens(config, words)
        else:
            self.net = TokenGRU(
                config.codebook_size, words, config.word_dim, config.text_width, config.width, config.tags,
                config.positions, config.dropout,
            )  # fmt: skip

    def nll(
        self, batch: TokenBatch, free: Tensor | None = None, generator: torch.Generator | None = None
    ) -> tuple[Tensor, Tensor]:
        """Negative log-likelihood (B, S + 1) of each token and the end, zero at padding, and the mask of those.

        Rows `free` (indices) read their own draws, the others the true tokens.
        """
        smoothing = self.config.label_smoothing if self.training else 0.0
        tokens = batch.tokens[..., 0] if batch.tokens.dim() == 3 else batch.tokens  # the base of tokens in layers
        inputs = F.pad(tokens, (1, 0), value=self.start_token)  # (B, S + 1)
        valid = length_mask(batch.token_count + 1, inputs.shape[1])  # (B, S + 1), the end included
        targets = F.pad(tokens, (0, 1)).scatter(1, batch.token_count[:, None], self.end_token)
        targets = targets.masked_fill(~valid, self.pad_token)
        if self.training and self.config.token_dropout:
            hidden = torch.rand(inputs.shape, generator=generator, device=inputs.device) < self.config.token_dropout
            hidden[:, 0] = False  # the start says nothing that could be leaned on
            inputs = inputs.masked_fill(hidden, self.pad_token)
        state: Any = self.net.start(*self._sentences(batch, generator))
        states = self.net.unroll(state, inputs, free, generator)  # (B, S + 1, h)
        # The output layer is the widest product of all: padding does not pass through it.
        losses = torch.zeros(valid.shape, device=inputs.device)
        losses[valid] = F.cross_entropy(
            self.net.logits(states[valid]), targets[valid], reduction="none", label_smoothing=smoothing
        )
        return losses, valid

    def loss(self, batch: TokenBatch, progress: float, generator: torch.Generator) -> Loss:
        """Mean over all tokens of the batch, with scheduled teacher forcing, one coin per sequence."""
        first, last = self.config.teacher_forcing_start, self.config.teacher_forcing_end
        forcing = first + (last - first) * progress
        coins = torch.rand(len(batch.tokens), generator=generator, device=batch.tokens.device)  # (B,)
        free = (coins >= forcing).nonzero()[:, 0]
        losses, valid = self.nll(batch, free, generator)
        loss = losses.sum() / valid.sum()
        return loss, {"token_nll": loss.detach(), "teacher_forcing": torch.tensor(forcing)}

    def validate(self, batch: TokenBatch) -> dict[str, Tensor]:
        """The teacher-forced loss per token."""
        losses, valid = self.nll(batch)
        return {"loss": losses.sum() / valid.sum()}

    def _sentences(self, batch: TokenBatch, generator: torch.Generator | None) -> tuple[Tensor, Tensor | None, Tensor]:
        words, tags, count = batch.words, batch.tags, batch.word_count
        if self.training and generator is not None:
            words = hide_words(words, self.config.word_dropout, generator)
        if self.training and self.config.text_dropout:
            empty = torch.rand(len(words), generator=generator, device=words.device) < self.config.text_dropout
            words, tags, count = blank(words, tags, count, empty)
        return words, tags, count


def blank(words: Tensor, tags: Tensor | None, count: Tensor, rows: Tensor) -> tuple[Tensor, Tensor | None, Tensor]:
    """Replace the sentences of `rows` (B,) bool by the empty one: start and end only."""

    def shorten(values: Tensor) -> Tensor:
        """The first value of each row and its last, which become those of the empty sentence; zeros behind."""
        empty = torch.zeros_like(values)
        empty[:, :1], empty[:, 1:2] = values[:, :1], values.gather(1, count[:, None] - 1)
        return torch.where(rows[:, None], empty, values)

    return shorten(words), None if tags is None else shorten(tags), torch.where(rows, 2, count)
