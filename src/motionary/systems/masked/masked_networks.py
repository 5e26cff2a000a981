"""The networks of masked generation: the text that is read, the plan of base tokens, the detail of the other layers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, cast

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from motionary.language import STATE_DIM
from motionary.nn.layers import WordEmbedding, length_mask, positional_encoding
from motionary.nn.transformer import Attention, FeedForward
from motionary.systems.masked.examples import Examples, mean_state


@dataclass(frozen=True)
class Text:
    """Sentences as words with their classes and as token states of the frozen language model.

    Attributes:
        words, tags: (B, N) ids.
        word_count: (B,) of them.
        states: (B, M, d), zero beyond `state_count` (B,).
        examples: training clips that are looked at as well, where the model was made for them.
    """

    words: Tensor
    tags: Tensor | None
    word_count: Tensor
    states: Tensor
    state_count: Tensor
    examples: Examples | None = None

    def twice(self) -> Text:
        """The batch twice over: all B sentences, then the same B again."""
        tags = None if self.tags is None else torch.cat((self.tags, self.tags))
        words, count, states, state_count = (
            torch.cat((x, x)) for x in (self.words, self.word_count, self.states, self.state_count)
        )
        return Text(words, tags, count, states, state_count, self.examples and self.examples.twice())


class Memory(NamedTuple):
    """What the text says: vectors (B, N, width) to attend to, their mask (B, N), and the whole sentence (B, width)."""

    vectors: Tensor
    mask: Tensor
    sentence: Tensor


class TextReader(nn.Module):
    """Text to a memory of one vector for no text, then words, then states, then examples.

    Args:
        codes: that tokens of examples may have; 0 where none are looked at.
    """

    def __init__(self, words: int, word_dim: int, width: int, dropout: float, codes: int = 0):
        super().__init__()
        self.embedding = WordEmbedding(words, word_dim, tags=True)
        self.words, self.states = nn.Linear(word_dim, width), nn.Linear(STATE_DIM, width)
        self.sentence = nn.Linear(STATE_DIM, width)
        self.norms = nn.ModuleList(nn.LayerNorm(width) for _ in range(2))
        self.blank = nn.Parameter(0.02 * torch.randn(2, width))  # without text: to attend to, and as the sentence
        self.examples = nn.Embedding(codes, width) if codes else None
        self.dropout = nn.Dropout(dropout)

    def forward(self, text: Text, blank: Tensor) -> Memory:
        """blank (B,) bool: items whose text is left out."""
        words = self.norms[0](self.words(self.embedding(text.words, text.tags)))
        states = self.norms[1](self.states(text.states.to(words.dtype)))
        nothing = self.blank[0].expand(len(words), 1, -1)
        parts = [words, states]
        masks = [length_mask(text.word_count, words.shape[1]), length_mask(text.state_count, states.shape[1])]
        if self.examples is not None and text.examples is not None:
            codes, count = text.examples
            at = torch.arange(codes.shape[-1], device=codes.device)
            parts.append((self.examples(codes) + positional_encoding(at, words.shape[-1])).flatten(1, 2))
            masks.append(length_mask(count.flatten(), codes.shape[-1]).view(len(count), -1))
        told = torch.cat(masks, 1) & ~blank[:, None]
        mean = mean_state(text.states, text.state_count)
        sentence = torch.where(blank[:, None], self.blank[1], self.sentence(mean.to(words.dtype)))
        vectors = self.dropout(torch.cat((nothing, *parts), 1))
        return Memory(vectors, F.pad(told, (1, 0), value=True), sentence)


class ReadingLayer(nn.Module):
    """Self-attention in both directions, attention on the text, feed-forward; each on a normalized input."""

    def __init__(self, width: int, heads: int, inner: int, dropout: float):
        super().__init__()
        self.attention, self.text_attention = Attention(width, heads), Attention(width, heads)
        self.forward_part = FeedForward(width, inner)
        self.norms = nn.ModuleList(nn.LayerNorm(width) for _ in range(3))
        self.dropout = nn.Dropout(dropout)

    def forward(self, x: Tensor, valid: Tensor, text: tuple[Tensor, Tensor], text_mask: Tensor) -> Tensor:
        """x (B, S, width), valid (B, 1, 1, S), keys and values of the text and their mask (B, 1, 1, N)."""
        normal = self.norms[0](x)
        x = x + self.dropout(self.attention(normal, *self.attention.keys_values(normal), valid))
        x = x + self.dropout(self.text_attention(self.norms[1](x), *text, text_mask))
        return x + self.dropout(self.forward_part(self.norms[2](x)))


class TokenReader(nn.Module):
    """Embedded tokens that see each other, their places from both ends, and the text."""

    def __init__(self, width: int, heads: int, inner: int, layers: int, dropout: float):
        super().__init__()
        self.layers = nn.ModuleList(ReadingLayer(width, heads, inner, dropout) for _ in range(layers))
        self.ends = nn.Linear(width, width)
        self.norm, self.dropout = nn.LayerNorm(width), nn.Dropout(dropout)

    def read(self, memory: Memory) -> list[tuple[Tensor, Tensor]]:
        """Keys and values of the text for each layer; a generation computes them once."""
        layers = cast(Sequence[ReadingLayer], self.layers)
        return [layer.text_attention.keys_values(memory.vectors) for layer in layers]

    def forward(self, x: Tensor, count: Tensor, memory: Memory, text: Sequence[tuple[Tensor, Tensor]]) -> Tensor:
        """x (B, S, width) of which count (B,) are valid, and what `read` gave -> (B, S, width)."""
        at = torch.arange(x.shape[1], device=x.device)
        left = (count[:, None] - 1 - at).clamp(min=0)  # (B, S) tokens that are still to come
        places = positional_encoding(at, x.shape[-1]) + self.ends(positional_encoding(left, x.shape[-1]).to(x.dtype))
        x = self.dropout(x + places + memory.sentence[:, None])
        valid = length_mask(count, x.shape[1])[:, None, None]
        for layer, pair in zip(self.layers, text, strict=True):
            x = layer(x, valid, pair, memory.mask[:, None, None])
        return self.norm(x)


class BasePlan(nn.Module):
    """Base codes, some of them masked, to a distribution over all K at each place. Code K is the mask."""

    def __init__(self, codes: int, reader: TokenReader, width: int):
        super().__init__()
        self.embedding, self.reader, self.output = nn.Embedding(codes + 1, width), reader, nn.Linear(width, codes)
        nn.init.normal_(self.embedding.weight, std=0.5)

    def forward(self, codes: Tensor, count: Tensor, memory: Memory, text: Sequence[tuple[Tensor, Tensor]]) -> Tensor:
        """(B, S) -> logits (B, S, K)."""
        return self.output(self.reader(self.embedding(codes), count, memory, text))


class ResidualDetail(nn.Module):
    """The sum of the entries of the layers so far to a distribution over the codes of the next layer.

    Logits are products with that layer's entries, since codes that lie close mean nearly the same.
    """

    scale: Tensor

    def __init__(self, layers: int, codes: int, dim: int, reader: TokenReader, width: int):
        super().__init__()
        self.input, self.reader, self.output = nn.Linear(dim, width), reader, nn.Linear(width, dim)
        self.level = nn.Embedding(layers, width)  # row 0 is not used: the base has no layer before it
        self.bias = nn.Parameter(torch.zeros(layers, codes))
        self.register_buffer("scale", torch.ones(layers))  # root mean square of the entries of each layer

    @torch.no_grad()
    def take_codebooks(self, codebooks: Tensor) -> None:
        """The tokenizer's entries (L, K, d)."""
        self.scale.copy_(codebooks.square().mean((1, 2)).sqrt().clamp(min=1e-6))

    def forward(
        self,
        so_far: Tensor,
        level: int | Tensor,
        count: Tensor,
        memory: Memory,
        text: Sequence[tuple[Tensor, Tensor]],
    ) -> Tensor:
        """so_far (B, S, d), the layer that is asked for, one or (B,) -> (B, S, d) for :meth:`logits`."""
        levels = torch.as_tensor(level, device=so_far.device).expand(len(so_far))
        x = self.input(so_far / self.scale[0]) + self.level(levels)[:, None]
        return self.output(self.reader(x, count, memory, text))

    def logits(self, told: Tensor, level: int, codebook: Tensor) -> Tensor:
        """told (..., d), codebook (K, d) of the layer -> (..., K)."""
        return F.linear(told * told.shape[-1] ** -0.5, codebook / self.scale[level], self.bias[level])
