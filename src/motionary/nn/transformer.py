"""The Transformer (Vaswani et al., 2017) over token sequences that both directions share, with cached decoding.

Deviations from the original, here as in most of today's models: layers normalize their input (pre-norm, which needs no
long warm-up) and dropout acts on the branches' outputs, not on attention weights, so that the fused attention kernel
serves training too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from motionary.nn.layers import positional_encoding
from motionary.nn.precision import full_precision


class Attention(nn.Module):
    """Multi-head attention of x (B, T, d) on a memory whose keys and values were computed before."""

    def __init__(self, width: int, heads: int):
        super().__init__()
        self.heads = heads
        # Separate layers: gradients of one joint layer would be concatenated, which costs more than it saves on CPUs.
        self.query, self.key, self.value = (nn.Linear(width, width) for _ in range(3))
        self.out = nn.Linear(width, width)

    def keys_values(self, memory: Tensor) -> tuple[Tensor, Tensor]:
        """(B, N, d) -> keys and values, each (B, heads, N, d / heads)."""
        return self._split(self.key(memory)), self._split(self.value(memory))

    def forward(self, x: Tensor, keys: Tensor, values: Tensor, mask: Tensor | None = None, causal: bool = False):
        """`mask` (B, 1, 1 or T, N) is true where attention may look."""
        attended = attend(self._split(self.query(x)), keys, values, mask, causal)
        return self.out(attended.transpose(1, 2).flatten(2))

    def _split(self, x: Tensor) -> Tensor:
        return x.unflatten(-1, (self.heads, -1)).transpose(1, 2)


def attend(query: Tensor, keys: Tensor, values: Tensor, mask: Tensor | None = None, causal: bool = False) -> Tensor:
    """Scaled dot-product attention of (B, heads, T, d) on (B, heads, N, d) -> (B, heads, T, d)."""
    if query.device.type == "cpu" and query.dtype == torch.bfloat16:
        # There the fused kernel takes six times as long in bfloat16 as in 32 bits.
        with full_precision(query):
            return attend(query.float(), keys.float(), values.float(), mask, causal).to(query.dtype)
    return F.scaled_dot_product_attention(query, keys, values, mask, is_causal=causal)


class FeedForward(nn.Sequential):
    """Two linear layers around a ReLU, on (B, T, d)."""

    def __init__(self, width: int, inner: int):
        super().__init__(nn.Linear(width, inner), nn.ReLU(inplace=True), nn.Linear(inner, width))

    def forward(self, x: Tensor) -> Tensor:  # type: ignore[override]
        # Flat: a linear layer's output on three dimensions is a view, and changing a view in place costs copies.
        """(B, T, d) -> (B, T, d)."""
        return super().forward(x.flatten(0, -2)).view(x.shape)


class EncoderLayer(nn.Module):
    """Self-attention and feed-forward, each on a normalized input and added to it."""

    def __init__(self, width: int, heads: int, inner: int, dropout: float):
        super().__init__()
        self.attention = Attention(width, heads)
        self.forward_part = FeedForward(width, inner)
        self.norms = nn.ModuleList(nn.LayerNorm(width) for _ in range(2))
        self.dropout = nn.Dropout(dropout)

    def forward(self, x: Tensor, mask: Tensor) -> Tensor:
        """x (B, N, d), mask of valid positions -> (B, N, d)."""
        normal = self.norms[0](x)
        x = x + self.dropout(self.attention(normal, *self.attention.keys_values(normal), mask))
        return x + self.dropout(self.forward_part(self.norms[1](x)))


class DecoderLayer(nn.Module):
    """Causal self-attention, attention on the source, feed-forward."""

    def __init__(self, width: int, heads: int, inner: int, dropout: float):
        super().__init__()
        self.attention = Attention(width, heads)
        self.source_attention = Attention(width, heads)
        self.forward_part = FeedForward(width, inner)
        self.norms = nn.ModuleList(nn.LayerNorm(width) for _ in range(3))
        self.dropout = nn.Dropout(dropout)

    def forward(self, x: Tensor, source: tuple[Tensor, Tensor], mask: Tensor) -> Tensor:
        """x (B, T, d), keys and values of the source, its mask -> (B, T, d)."""
        normal = self.norms[0](x)
        x = x + self.dropout(self.attention(normal, *self.attention.keys_values(normal), causal=True))
        return self._rest(x, source, mask)

    def step(self, x: Tensor, past: tuple[Tensor, Tensor] | None, source: tuple[Tensor, Tensor], mask: Tensor):
        """One position x (R, 1, d) after the cached ones -> its output and the grown cache."""
        normal = self.norms[0](x)
        now = self.attention.keys_values(normal)
        grown = now if past is None else tuple(torch.cat(pair, dim=2) for pair in zip(past, now, strict=True))
        x = x + self.dropout(self.attention(normal, *grown))
        return self._rest(x, source, mask), grown

    def _rest(self, x: Tensor, source: tuple[Tensor, Tensor], mask: Tensor) -> Tensor:
        x = x + self.dropout(self.source_attention(self.norms[1](x), *source, mask))
        return x + self.dropout(self.forward_part(self.norms[2](x)))


@dataclass(frozen=True)
class Cache:
    """What decoding remembers: per layer the keys and values of the past and of the source.

    The source's belong to items, not to rows (`item` maps one to the other): permuting the beams of an item, which
    beam search does at every word, then moves only the short past.
    """

    past: tuple[tuple[Tensor, Tensor] | None, ...]
    source: tuple[tuple[Tensor, Tensor], ...]
    mask: Tensor  # (R, 1, 1, N)
    item: Tensor  # (R,)
    position: int = 0

    def reorder(self, index: Tensor) -> Cache:
        """Row i becomes row index[i]."""
        item = self.item[index]
        source, mask = self.source, self.mask
        if not torch.equal(item, self.item):
            source = tuple((keys[index], values[index]) for keys, values in source)
            mask = mask[index]
        past = tuple(None if pair is None else (pair[0][index], pair[1][index]) for pair in self.past)
        return Cache(past, source, mask, item, self.position)


class TokenTransformer(nn.Module):
    """Encoder and decoder stacks over embedded sequences; positions are sinusoids added to the embeddings."""

    def __init__(self, width: int, heads: int, inner: int, encoder_layers: int, decoder_layers: int, dropout: float):
        super().__init__()
        self.encoder = nn.ModuleList(EncoderLayer(width, heads, inner, dropout) for _ in range(encoder_layers))
        self.decoder = nn.ModuleList(DecoderLayer(width, heads, inner, dropout) for _ in range(decoder_layers))
        self.encoder_norm, self.decoder_norm = nn.LayerNorm(width), nn.LayerNorm(width)
        self.dropout = nn.Dropout(dropout)

    def encode(self, x: Tensor, mask: Tensor) -> Tensor:
        """Embedded source (B, N, d), mask (B, N) true at valid positions -> memory (B, N, d)."""
        x = self._place(x, 0)
        for layer in self.encoder:
            x = layer(x, mask[:, None, None])
        return self.encoder_norm(x)

    def decode(self, x: Tensor, memory: Tensor, mask: Tensor) -> Tensor:
        """Embedded target prefix (B, T, d) -> (B, T, d); position t sees targets up to t and the whole source."""
        x = self._place(x, 0)
        for layer in self._layers():
            x = layer(x, layer.source_attention.keys_values(memory), mask[:, None, None])
        return self.decoder_norm(x)

    def start(self, memory: Tensor, mask: Tensor) -> Cache:
        """The cache before the first target position."""
        source = tuple(layer.source_attention.keys_values(memory) for layer in self._layers())
        item = torch.arange(len(memory), device=memory.device)
        return Cache((None,) * len(source), source, mask[:, None, None], item)

    def step(self, x: Tensor, cache: Cache) -> tuple[Tensor, Cache]:
        """One embedded target token per row x (R, d) -> its output (R, d) and the new cache; equals `decode`."""
        x = self._place(x[:, None], cache.position)
        past = []
        for layer, before, source in zip(self._layers(), cache.past, cache.source, strict=True):
            x, grown = layer.step(x, before, source, cache.mask)
            past.append(grown)
        cache = Cache(tuple(past), cache.source, cache.mask, cache.item, cache.position + 1)
        return self.decoder_norm(x)[:, 0], cache

    def _layers(self) -> list[DecoderLayer]:
        return cast(list[DecoderLayer], list(self.decoder))

    def _place(self, x: Tensor, first: int) -> Tensor:
        positions = torch.arange(first, first + x.shape[1], device=x.device)
        return self.dropout(x + positional_encoding(positions, x.shape[-1]).to(x.dtype))
