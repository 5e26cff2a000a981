"""Blocks that several systems share: normalizing, masks, positions, embeddings, the text encoder, initialization."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch
from torch import Tensor, nn

from motionary.errors import InputError
from motionary.language import END, TAGS, UNKNOWN
from motionary.nn.precision import widened
from motionary.nn.recurrent import BiGRU

SPREAD = 0.4  # root mean square of a word vector's entries, about that of GloVe's 300-d vectors


class Normalizer(nn.Module):
    """z-scores with the training split's statistics, which are saved with the weights and so are the same in use."""

    mean: Tensor
    std: Tensor

    def __init__(self, mean: np.ndarray, std: np.ndarray):
        super().__init__()
        mean, std = np.asarray(mean, dtype=np.float32), np.asarray(std, dtype=np.float32)
        if mean.shape != std.shape or not (std > 0).all():
            raise InputError("std", std.shape, "must have the shape of mean and be positive")
        self.register_buffer("mean", torch.tensor(mean))
        self.register_buffer("std", torch.tensor(std))

    def forward(self, raw: Tensor) -> Tensor:
        """(..., D) raw features -> normalized."""
        return (raw - self.mean) / self.std

    def inverse(self, normalized: Tensor) -> Tensor:
        """(..., D) normalized features -> raw."""
        return normalized * self.std + self.mean


def length_mask(lengths: Tensor, steps: int) -> Tensor:
    """(B,) lengths -> (B, steps) bool, true at valid steps."""
    return torch.arange(steps, device=lengths.device) < lengths[:, None]


def masked_mean(values: Tensor, mask: Tensor) -> Tensor:
    """Mean of values (B, T) or (B, T, D) over the steps that mask (B, T) keeps."""
    values = widened(values)
    if values.dim() == 3:
        values = values.mean(-1)
    weight = mask.to(values.dtype)
    return (values * weight).sum() / weight.sum().clamp(min=1)


def positional_encoding(positions: Tensor, dim: int) -> Tensor:
    """Sinusoids (thesis Eq. 4.5) of positions (...,) -> (..., dim); sine on even, cosine on odd dimensions."""
    half = torch.arange(0, dim, 2, device=positions.device, dtype=torch.float32)
    angles = positions[..., None].float() * torch.exp(half * (-math.log(10000.0) / dim))
    return torch.stack((angles.sin(), angles.cos()), dim=-1).flatten(-2)[..., :dim]


class WordEmbedding(nn.Module):
    """Word vectors plus, where asked for, an embedding of each word's class (thesis 4.2.3)."""

    def __init__(self, words: int, dim: int, tags: bool = True):
        super().__init__()
        self.words = nn.Embedding(words, dim, padding_idx=0)
        self.tags = nn.Embedding(len(TAGS), dim) if tags else None
        nn.init.normal_(self.words.weight, std=SPREAD)
        with torch.no_grad():
            self.words.weight[0] = 0
        if self.tags is not None:
            nn.init.normal_(self.tags.weight, std=0.5 * SPREAD)

    def forward(self, ids: Tensor, tags: Tensor | None = None) -> Tensor:
        """ids (B, N), tags (B, N) | None -> (B, N, dim). Padding ids (0) give a zero word vector."""
        embedded = self.words(ids)
        if self.tags is not None and tags is not None:
            embedded = embedded + self.tags(tags)
        return embedded

    @torch.no_grad()
    def start_from(self, vectors: np.ndarray) -> None:
        """Start from pretrained word vectors (V, d): centered, cut to `dim` principal axes, scaled to SPREAD.

        Rows that are all zero (words the source does not know) keep their random start.
        """
        table = torch.as_tensor(np.asarray(vectors), dtype=torch.float32)
        if table.dim() != 2 or table.shape[0] != self.words.num_embeddings:
            raise InputError("word vectors", tuple(table.shape), f"must have {self.words.num_embeddings} rows")
        known = table.abs().sum(1) > 0
        known[0] = False
        if not bool(known.any()):
            return
        rows = table[known] - table[known].mean(0)
        _, _, axes = torch.linalg.svd(rows, full_matrices=False)
        rows = rows @ axes[: self.words.embedding_dim].t()
        rows = rows * SPREAD * self.words.embedding_dim**0.5 / rows.norm(dim=1).mean().clamp(min=1e-8)
        start = torch.zeros(rows.shape[0], self.words.embedding_dim)
        start[:, : rows.shape[1]] = rows
        self.words.weight[known.to(self.words.weight.device)] = start.to(self.words.weight.device)


class TextEncoder(nn.Module):
    """Embedding, linear layer and bidirectional GRU (thesis 4.2.3; TM2T Table 3)."""

    def __init__(self, words: int, word_dim: int, hidden: int, tags: bool = True, dropout: float = 0.0):
        super().__init__()
        self.embedding = WordEmbedding(words, word_dim, tags)
        self.input = nn.Linear(word_dim, hidden)
        self.dropout = nn.Dropout(dropout)
        self.recurrent = BiGRU(hidden, hidden)
        self.width = 2 * hidden

    def forward(self, ids: Tensor, tags: Tensor | None, count: Tensor) -> tuple[Tensor, Tensor]:
        """ids (B, N), tags (B, N) | None, count (B,) -> word features (B, N, 2h), zero at padding, and the sentence
        feature (B, 2h), the last states of both directions."""
        return self.recurrent(self._read(ids, tags), count)

    def sentence(self, ids: Tensor, tags: Tensor | None, count: Tensor) -> Tensor:
        """The sentence feature (B, 2h) alone, which costs less than :meth:`forward`."""
        return self.recurrent.last(self._read(ids, tags), count)

    def _read(self, ids: Tensor, tags: Tensor | None) -> Tensor:
        return self.dropout(self.input(self.embedding(ids, tags)))


def hide_words(words: Tensor, share: float, generator: torch.Generator) -> Tensor:
    """Word ids (B, N) of which a share is replaced by the unknown word; special ids stay."""
    if not share:
        return words
    hidden = torch.rand(words.shape, generator=generator, device=words.device) < share
    return words.masked_fill(hidden & (words > END), UNKNOWN)


def load_word_vectors(model: nn.Module, vectors: np.ndarray | None) -> None:
    """Start every word embedding inside `model` from pretrained vectors (V, d); None leaves them learned."""
    if vectors is None:
        return
    for module in model.modules():
        if isinstance(module, WordEmbedding):
            module.start_from(vectors)


def initialize(module: nn.Module) -> None:
    """Xavier-uniform weights and zero biases for every linear layer inside `module`."""
    for layer in module.modules():
        if isinstance(layer, nn.Linear):
            nn.init.xavier_uniform_(layer.weight)
            if layer.bias is not None:
                nn.init.zeros_(layer.bias)


@contextmanager
def seeded(seed: int) -> Iterator[None]:
    """Build a module from a seed: inside, torch's default generator starts at `seed`; outside it is as it was."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        yield
