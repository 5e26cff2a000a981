"""Sentences as the masked networks read them, and classifier-free guidance by them (Ho and Salimans, 2022)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import torch
from torch import Tensor

from motionary.corpus.context import Context
from motionary.language import Sentence, TextStates
from motionary.systems.masked.masked_networks import Text, TextReader, TokenReader
from motionary.systems.requests import encode_sentences


def text_of(sentences: Sequence[Sentence], context: Context, states: TextStates, device: str) -> Text:
    """The sentences as words and as token states of the frozen language model."""
    words, tags, count = encode_sentences(context, sentences, device)
    found, state_count = (torch.from_numpy(x).to(device) for x in states([s.text for s in sentences]))
    return Text(words, tags, count, found, state_count)


class TextGuidance:
    """Passes of one network with a text and, where guidance asks for it, without: none + scale (text - none).

    Both are one batch; the text's keys and values are computed once.
    """

    def __init__(self, texts: TextReader, reader: TokenReader, text: Text, told: Tensor, scale: float):
        self.scale, self.twice = scale, scale != 1 and bool(told.any())
        blank = torch.cat((~told, torch.ones_like(told))) if self.twice else ~told
        self.memory = texts(text.twice() if self.twice else text, blank)
        self.read = reader.read(self.memory)

    def __call__(self, told: Callable[..., Tensor], x: Tensor, count: Tensor) -> Tensor:
        """(B, S, K) of `told(x, count, memory, read)`: log-probabilities or velocities."""
        return self.mixed(told(self.both(x), self.both(count), self.memory, self.read))

    def both(self, x: Tensor) -> Tensor:
        """What goes in (B, ...), once for each pass: with the text and, where guidance asks for it, without."""
        return torch.cat((x, x)) if self.twice else x

    def mixed(self, out: Tensor) -> Tensor:
        """What came out of the passes, as one (B, ...)."""
        if not self.twice:
            return out
        with_text, without = out.chunk(2)
        return without + self.scale * (with_text - without)
