"""Captions of motions with a trained motion2text: beam search, draws, consensus of draws."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from motionary.errors import InputError
from motionary.language import END, PAD, START, UNKNOWN
from motionary.language.consensus import consensus as agree
from motionary.nn.decoding import Averaged, Sampling, beam_search, sample
from motionary.nn.noise import uniform_noise
from motionary.nn.transformer import Cache
from motionary.systems.tm2t.motion2text import Motion2Text
from motionary.systems.tm2t.tokenizer import Tokenizer

_NEVER = (PAD, START, UNKNOWN)


class Captioner:
    """Captions motions with the members of a trained Motion2Text.

    Results never depend on the other motions of the call.
    """

    draws = True  # can choose a caption by consensus of draws

    def __init__(
        self, members: Sequence[Motion2Text], tokenizer: Tokenizer | None, chunk: int = 64, offsets: int | None = None
    ):
        self.members, self.tokenizer, self.chunk = [model.eval() for model in members], tokenizer, chunk
        self.config, self.context = members[0].config, members[0].context
        self.offsets = self.config.offsets if offsets is None else offsets
        self.written = self.config.wording == "written"
        self.sources = self.config.sources

    @torch.no_grad()
    def caption(
        self,
        features: Sequence[np.ndarray],
        beams: int = 2,
        n: int = 1,
        seeds: Sequence[int] | None = None,
        temperature: float | None = None,
        consensus: int = 0,
        source: str | None = None,
        quick: bool = False,
    ) -> list[list[str]]:
        """n captions for each motion (T, D), as :meth:`MotionToText.caption` says.

        Beam search takes the mean probability of each word over the members and over the `offsets` that they were
        trained with; draws take turns.
        """
        for number, array in enumerate(features):
            if array.ndim != 2 or array.shape[1] != len(self.context.mean) or len(array) < 1:
                raise InputError(
                    f"features[{number}]", array.shape, f"must be (T, {len(self.context.mean)}) with at least one frame"
                )
        if n < 1:
            raise InputError("n", n, "must be at least 1")
        tag = 0 if source is None else self.sources.index(source)
        if quick and (self.offsets > 1 or len(self.members) > 1):
            alone = Captioner(self.members[:1], self.tokenizer, self.chunk, offsets=1)
            return alone.caption(features, beams, n, seeds, temperature, consensus, source)
        seeds = [0] * len(features) if seeds is None else seeds
        # Similar lengths share a chunk, so little is padded.
        order = np.argsort([len(array) for array in features], kind="stable")
        draws = n if temperature is not None else consensus
        chunk = max(1, min(self.chunk // self.offsets, 4 * self.chunk // max(1, draws)))
        results: list[list[str]] = [[] for _ in features]
        for first in range(0, len(order), chunk):
            chosen = order[first : first + chunk]
            states = self._start([reading for i in chosen for reading in self._readings(features[i])], tag)
            own = [seeds[i] for i in chosen]
            if temperature is not None:
                captions = self._sample(states, own, n, temperature)
            else:
                captions = self._search(states, len(chosen), beams, n if not consensus else max(beams, n))
            if consensus and temperature is None:
                drawn = self._sample(states, own, consensus, 1.0)
                captions = [agree([*best, *more], more)[:n] for best, more in zip(captions, drawn, strict=True)]
            for i, caption in zip(chosen, captions, strict=True):
                results[i] = caption
        return results

    def _start(self, features: list[np.ndarray], tag: int) -> list[Cache]:
        """Each member's state before the first word, one row for each of the raw features (T, D)."""
        unit, device = self.context.unit, self.members[0].words.weight.device
        longest = -(-max(len(array) for array in features) // unit) * unit
        motion = torch.zeros(len(features), longest, features[0].shape[1])
        for row, array in zip(motion, features, strict=True):
            row[: len(array)] = torch.tensor(array)  # a copy: the corpus is a read-only map
            # A motion shorter than one unit holds its last frame.
            row[len(array) : unit] = row[len(array) - 1]
        frames = torch.tensor([max(unit, len(array) // unit * unit) for array in features])
        motion, frames = motion.to(device), frames.to(device)
        if self.tokenizer is None:
            return [model.start(*model.tagged(*model.embed_motion(motion, frames), tag)) for model in self.members]
        tokens, count = self.tokenizer.encode(motion, frames), frames // unit
        return [model.start(*model.tagged(*model.embed_tokens(tokens, count), tag)) for model in self.members]

    def _readings(self, motion: np.ndarray) -> list[np.ndarray]:
        """The motion (T, D) from its first, second, ... frame on, `offsets` times; each keeps at least one unit."""
        latest = max(0, len(motion) - self.context.unit)
        return [motion[min(start, latest) :] for start in range(self.offsets)]

    def _search(self, states: list[Cache], items: int, beams: int, n: int) -> list[list[str]]:
        """The n likeliest captions of each item, averaged over members and readings."""
        start = torch.full((items,), START, device=states[0].item.device)
        decoder = Averaged(self.members, self.offsets)
        found = beam_search(decoder, states, start, END, beams, n, self.config.max_words, banned=_NEVER)
        return [[self._text(hypothesis.tokens) for hypothesis in item] for item in found]

    def _sample(self, states: list[Cache], seeds: list[int], n: int, temperature: float) -> list[list[str]]:
        """n captions for each seed; members, and the readings of an item, take turns.

        The tail of each distribution that label smoothing spread over all words is left out: of ten words one would
        come from it.
        """
        steps, ways = self.config.max_words, len(self.members)
        sampling = Sampling(temperature, top_p=1 - self.config.label_smoothing)
        noise = uniform_noise(seeds, n * steps).view(len(seeds), n, steps)
        texts = [[""] * n for _ in seeds]
        for first, (model, state) in enumerate(zip(self.members, states, strict=True)):
            turns = torch.arange(first, n, ways)  # this member's draws
            readings = state.item.view(len(seeds), -1)
            own = model.reorder(state, readings[:, turns // ways % readings.shape[1]].flatten())
            start = torch.full((len(own.item),), START, device=readings.device)
            words, count = sample(model, own, start, END, noise[:, turns].flatten(0, 1), steps, sampling, _NEVER)
            for row, (tokens, length) in enumerate(zip(words, count, strict=True)):
                texts[row // len(turns)][int(turns[row % len(turns)])] = self._text(tokens[:length].tolist())
        return texts

    def _text(self, words: list[int]) -> str:
        return self.context.vocabulary.decode(np.array(words, dtype=np.int64))
