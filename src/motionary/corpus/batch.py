"""`Batch`, what datasets give, and what of it a loss reads: one protocol for each need."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from torch import Tensor


class MotionBatch(Protocol):
    """Motions.

    Attributes:
        motion: (B, T, D) float32 raw features, zero beyond `frames`.
        frames: (B,) valid frames.
    """

    motion: Tensor
    frames: Tensor


class LabeledBatch(MotionBatch, Protocol):
    """Motions with labels: `style` and `action` (B,) are label ids of the corpus's context, -1 where unknown."""

    style: Tensor
    action: Tensor


class ActedBatch(Protocol):
    """Joints of labeled motions.

    Attributes:
        joints: (B, T, J, 3) float32 metres, y up; at first the root stands above the origin and the body faces +z.
        frames: (B,) valid frames.
        action, fine: (B,) label ids among the coarse and the fine actions, -1 where unknown.
    """

    joints: Tensor
    frames: Tensor
    action: Tensor
    fine: Tensor


class TextBatch(Protocol):
    """Captions, and how long their motions last.

    Attributes:
        words: (B, N) ids START .. END, then PAD.
        word_count: (B,) of them, START and END included.
        tags: (B, N) word classes, or None.
        text_key: (B,) id of the distinct normalized text.
        frames: (B,) of each motion.
    """

    words: Tensor
    word_count: Tensor
    tags: Tensor | None
    text_key: Tensor
    frames: Tensor


class PairBatch(TextBatch, MotionBatch, Protocol):
    """Motions and their captions."""


class SentenceBatch(Protocol):
    """Captions as a frozen language model reads them.

    Attributes:
        states: (B, N, d) token states, zero beyond `state_count` (B,).
        text_key: (B,) id of the distinct normalized text.
    """

    states: Tensor
    state_count: Tensor
    text_key: Tensor


class JointBatch(SentenceBatch, Protocol):
    """Motions as joints alone, and their captions: `joints` (B, T, J, 3) in metres, zero beyond `frames` (B,)."""

    joints: Tensor
    frames: Tensor


class TokenBatch(TextBatch, Protocol):
    """Captions and the tokens of their motions: `tokens` (B, S) are codes 0 .. K-1, zero beyond `token_count` (B,)."""

    tokens: Tensor
    token_count: Tensor


class ReadBatch(MotionBatch, SentenceBatch, Protocol):
    """Motions, and their captions as a language model reads them; `states` may be its token ids (B, N) instead."""


class SourcedBatch(TokenBatch, Protocol):
    """`source` (B,) of each caption: its position among the sources that the model knows; only where it knows any."""

    source: Tensor


class AlignedBatch(SourcedBatch, Protocol):
    """`said` (B, N) are the captions' words as they were written, START .. END, then PAD; only where they are read."""

    said: Tensor


class CaptionBatch(SourcedBatch, PairBatch, Protocol):
    """Captions with what they describe; the loss reads the tokens or the features, whichever its model was made for."""


def _left_out() -> Any:
    return None


@dataclass(repr=False, eq=False)
class Batch:
    """One batch. What its dataset does not fill is not there: asking for it is an AttributeError that names it.

    Attributes:
        clip: (B,) rows of the corpus.
        caption: (B,) caption rows.
        others: see the protocols above.
    """

    clip: Tensor
    motion: Tensor = field(default_factory=_left_out)
    frames: Tensor = field(default_factory=_left_out)
    words: Tensor = field(default_factory=_left_out)
    word_count: Tensor = field(default_factory=_left_out)
    tags: Tensor | None = None
    text_key: Tensor = field(default_factory=_left_out)
    caption: Tensor = field(default_factory=_left_out)
    source: Tensor = field(default_factory=_left_out)
    said: Tensor = field(default_factory=_left_out)
    tokens: Tensor = field(default_factory=_left_out)
    token_count: Tensor = field(default_factory=_left_out)
    states: Tensor = field(default_factory=_left_out)
    state_count: Tensor = field(default_factory=_left_out)
    style: Tensor = field(default_factory=_left_out)
    action: Tensor = field(default_factory=_left_out)
    joints: Tensor = field(default_factory=_left_out)
    fine: Tensor = field(default_factory=_left_out)
    textless: Tensor | None = None

    def __post_init__(self) -> None:
        for name, value in list(vars(self).items()):
            if value is None:
                delattr(self, name)

    def __len__(self) -> int:
        return len(self.clip)

    def pinned(self) -> Batch:
        """The same batch in memory that a GPU copies from while it computes."""
        return Batch(**{name: value.pin_memory() for name, value in vars(self).items()})

    def to(self, device) -> Batch:
        """The same batch on another device."""
        return Batch(**{name: value.to(device, non_blocking=True) for name, value in vars(self).items()})


class Dataset(Protocol):
    """What `Batches` needs: a length, valid frames per entry, sampling weights or None, and a collate function."""

    lengths: np.ndarray
    weights: np.ndarray | None

    def __len__(self) -> int: ...

    def collate(self, indices: np.ndarray, rng: np.random.Generator) -> Batch:
        """The batch of the given entries; all randomness comes from `rng`."""
        ...
