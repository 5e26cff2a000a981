"""Checks and encodes the texts, seeds and lengths that a generator is called with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from motionary.corpus.context import Context
from motionary.errors import InputError, check_kind
from motionary.language import Sentence
from motionary.systems.protocols import SAMPLING

if TYPE_CHECKING:  # options are checked without torch
    from torch import Tensor


def encode_sentences(context: Context, sentences: Sequence[Sentence], device: Any) -> tuple[Tensor, Tensor, Tensor]:
    """Word ids and tags (B, N) and counts (B,) on a device, typos corrected."""
    import torch

    vocabulary = context.vocabulary
    arrays = vocabulary.encode_batch([vocabulary.correct(sentence) for sentence in sentences])
    words, tags, count = (torch.from_numpy(array).to(device) for array in arrays)
    return words, tags, count


def check_seeds(sentences: Sequence[Sentence], seeds: Sequence[int]) -> None:
    """InputError unless there is one seed per sentence."""
    if len(seeds) != len(sentences):
        raise InputError("seeds", len(seeds), f"must be one per sentence, {len(sentences)}")


def check_options(options: Mapping[str, Any]) -> None:
    """InputError for an option that sampling does not have, or one of another kind; ranges are each system's."""
    for name, value in options.items():
        if name not in SAMPLING:
            raise InputError(name, value, f"unknown option; known are {', '.join(SAMPLING)}")
        if value is not None:
            check_kind(name, value, SAMPLING[name])


def check_frames(context: Context, sentences: Sequence[Sentence], frames: Sequence[int]) -> list[int]:
    """The wanted lengths as whole numbers; InputError unless there is one per sentence that models can make: from one
    unit to the longest window of the corpus."""
    if len(frames) != len(sentences):
        raise InputError("frames", len(frames), f"must be one per sentence, {len(sentences)}")
    for wanted in frames:
        if isinstance(wanted, bool) or wanted != int(wanted) or not context.unit <= wanted <= context.max_frames:
            raise InputError("frames", wanted, f"must be a whole number from {context.unit} to {context.max_frames}")
    return [int(wanted) for wanted in frames]


class GuidanceSettings(Protocol):
    """Settings of a generator that guidance leads: its usual scale, and the share of captions it trained without."""

    @property
    def guidance(self) -> float:
        """Scale of classifier-free guidance; 1 is off."""
        ...

    @property
    def text_dropout(self) -> float:
        """Share of the captions that training left out."""
        ...


def chosen_guidance(config: GuidanceSettings, guidance: float | None) -> float:
    """The scale of classifier-free guidance that is asked for, or the config's; InputError for one out of range, or of
    a model that never trained without text."""
    chosen = config.guidance if guidance is None else guidance
    if not 0 <= chosen <= 1000:
        raise InputError("guidance", chosen, "must be in 0..1000")
    if chosen != 1 and not config.text_dropout:
        raise InputError("guidance", chosen, "must be 1: this model was trained without text_dropout")
    return chosen
