"""`Batch`, what every model takes, and what a dataset must offer to be batched."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Protocol

import numpy as np
from torch import Tensor


@dataclass
class Batch:
    """One batch; every field but `clip` is optional.

    Attributes:
        clip: (B,) rows of the corpus.
        motion: (B, T, D) float32 raw features, zero beyond `frames`.
        frames: (B,) valid frames.
        words: (B, N) ids START .. END, then PAD; `word_count` (B,) counts START and END; `tags` (B, N).
        text_key: (B,) id of the distinct normalized text; `caption` (B,) caption row.
        tokens: (B, S) motion codes 0 .. K-1, zero beyond `token_count` (B,).
        style, action: (B,) label ids of the corpus's context, -1 where unknown.
    """

    clip: Tensor
    motion: Tensor | None = None
    frames: Tensor | None = None
    words: Tensor | None = None
    word_count: Tensor | None = None
    tags: Tensor | None = None
    text_key: Tensor | None = None
    caption: Tensor | None = None
    tokens: Tensor | None = None
    token_count: Tensor | None = None
    style: Tensor | None = None
    action: Tensor | None = None

    def __len__(self) -> int:
        return len(self.clip)

    def to(self, device) -> Batch:
        """The same batch on another device."""
        moved = {
            field.name: value.to(device, non_blocking=True)
            for field in fields(self)
            if (value := getattr(self, field.name)) is not None
        }
        return replace(self, **moved)


class Dataset(Protocol):
    """What `Batches` needs: a length, valid frames per entry, sampling weights or None, and a collate function."""

    lengths: np.ndarray
    weights: np.ndarray | None

    def __len__(self) -> int: ...

    def collate(self, indices: np.ndarray, rng: np.random.Generator) -> Batch:
        """The batch of the given entries; all randomness comes from `rng`."""
        ...
