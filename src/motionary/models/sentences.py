"""What every generator does with the texts that it is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from motionary.errors import InputError
from motionary.language import Sentence

if TYPE_CHECKING:
    from motionary.corpus.context import Context


def encode_sentences(context: Context, sentences: Sequence[Sentence], device: Any) -> tuple[Tensor, Tensor, Tensor]:
    """Word ids and tags (B, N) and counts (B,) on a device, typos corrected."""
    vocabulary = context.vocabulary
    arrays = vocabulary.encode_batch([vocabulary.correct(sentence) for sentence in sentences])
    words, tags, count = (torch.from_numpy(array).to(device) for array in arrays)
    return words, tags, count


def check_seeds(sentences: Sequence[Sentence], seeds: Sequence[int]) -> None:
    """InputError unless there is one seed per sentence."""
    if len(seeds) != len(sentences):
        raise InputError("seeds", len(seeds), f"must be one per sentence, {len(sentences)}")


def check_frames(sentences: Sequence[Sentence], frames: Sequence[int]) -> list[int]:
    """The wanted lengths as whole numbers; InputError unless there is one positive number per sentence."""
    wanted = [int(f) for f in frames]
    if len(wanted) != len(sentences) or min(wanted, default=1) < 1:
        raise InputError("frames", wanted, "must be one positive number per sentence")
    return wanted
