"""Captions of motions with a trained motion2text: beam search, draws, consensus of draws."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from motionary.decoding import Averaged, Sampling, beam_search, sample, uniform_noise
from motionary.errors import InputError
from motionary.language import END, PAD, START, UNKNOWN
from motionary.models.consensus import consensus as agree

if TYPE_CHECKING:
    from motionary.models.motion2text import Motion2Text
    from motionary.models.token_transformer import Cache
    from motionary.models.tokenizer import Tokenizer

_NEVER = (PAD, START, UNKNOWN)


class Captioner:
    """Captions motions with a trained Motion2Text. Results never depend on the other motions of the call."""

    draws = True  # can choose a caption by consensus of draws

    def __init__(self, model: Motion2Text, tokenizer: Tokenizer | None, chunk: int = 64):
        self.model, self.tokenizer, self.chunk = model.eval(), tokenizer, chunk
        self.context = model.context

    @torch.no_grad()
    def caption(
        self,
        features: Sequence[np.ndarray],
        beams: int = 2,
        n: int = 1,
        seeds: Sequence[int] | None = None,
        temperature: float | None = None,
        consensus: int = 0,
    ) -> list[list[str]]:
        """n captions for each motion.

        Args:
            features: raw features (T, D) of each motion.
            beams: of beam search, which is used unless `temperature` is given (TM2T 4.3: 2).
            n: captions per motion, best first.
            seeds: one per motion, of whatever is drawn for it (0 where not given).
            temperature: draw the captions at this temperature instead.
            consensus: draws of which that one is the caption which agrees best with all (minimum Bayes risk); 0 is beam
                search alone (the paper's).

        Where the model was trained with several `shifts`, a beam search averages over them; draws take turns.

        Returns:
            for each motion, its captions: normalized words joined by spaces.
        """
        for number, array in enumerate(features):
            if array.ndim != 2 or array.shape[1] != len(self.context.mean) or len(array) < 1:
                raise InputError(
                    f"features[{number}]", array.shape, f"must be (T, {len(self.context.mean)}) with at least one frame"
                )
        if n < 1:
            raise InputError("n", n, "must be at least 1")
        seeds = [0] * len(features) if seeds is None else seeds
        # Similar lengths share a chunk, so little is padded.
        order = np.argsort([len(array) for array in features], kind="stable")
        draws = n if temperature is not None else consensus
        chunk = max(1, min(self.chunk // self.model.config.shifts, 4 * self.chunk // max(1, draws)))
        results: list[list[str]] = [[] for _ in features]
        for first in range(0, len(order), chunk):
            chosen = order[first : first + chunk]
            source, mask = self._source([reading for i in chosen for reading in self._readings(features[i])])
            state, own = self.model.start(source, mask), [seeds[i] for i in chosen]
            if temperature is not None:
                captions = self._sample(state, own, n, temperature)
            else:
                captions = self._search(state, len(chosen), beams, n if not consensus else max(beams, n))
            if consensus and temperature is None:
                drawn = self._sample(state, own, consensus, 1.0)
                captions = [agree([*best, *more], more)[:n] for best, more in zip(captions, drawn, strict=True)]
            for i, caption in zip(chosen, captions, strict=True):
                results[i] = caption
        return results

    def _source(self, features: list[np.ndarray]) -> tuple[Tensor, Tensor]:
        model, unit = self.model, self.context.unit
        device = model.words.weight.device
        longest = -(-max(len(array) for array in features) // unit) * unit
        motion = torch.zeros(len(features), longest, features[0].shape[1])
        for row, array in zip(motion, features, strict=True):
            row[: len(array)] = torch.tensor(array)  # a copy: the corpus is a read-only map
            # A motion shorter than one unit holds its last frame.
            row[len(array) : unit] = row[len(array) - 1]
        frames = torch.tensor([max(unit, len(array) // unit * unit) for array in features])
        motion, frames = motion.to(device), frames.to(device)
        if self.tokenizer is None:
            return model.embed_motion(motion, frames)
        ids, mask = model.token_source(self.tokenizer.encode(motion, frames), frames // unit)
        return model.embed(ids), mask

    def _readings(self, motion: np.ndarray) -> list[np.ndarray]:
        """A motion (T, D) from each of its starts, none of which cuts into a last unit."""
        latest = max(0, len(motion) - self.context.unit)
        return [motion[min(start, latest) :] for start in range(self.model.config.shifts)]

    def _search(self, state: Cache, items: int, beams: int, n: int) -> list[list[str]]:
        """The n likeliest captions of each item, averaged over its readings."""
        model, ways = self.model, self.model.config.shifts
        start = torch.full((items,), START, device=state.item.device)
        decoder = Averaged(model, ways) if ways > 1 else model
        found = beam_search(decoder, state, start, END, beams, n, model.config.most_words, banned=_NEVER)
        return [[self._text(hypothesis.tokens) for hypothesis in item] for item in found]

    def _sample(self, state: Cache, seeds: list[int], n: int, temperature: float) -> list[list[str]]:
        """n captions for each seed; the readings of an item take turns.

        The tail of each distribution that label smoothing spread over all words is left out: of ten words one would
        come from it.
        """
        model, steps = self.model, self.model.config.most_words
        readings = state.item.view(len(seeds), -1)
        turns = torch.arange(n, device=readings.device) % readings.shape[1]
        noise = uniform_noise(seeds, n * steps).view(len(seeds) * n, steps)
        state = model.reorder(state, readings[:, turns].flatten())
        start = torch.full((len(noise),), START, device=readings.device)
        sampling = Sampling(temperature, top_p=1 - model.config.label_smoothing)
        words, count = sample(model, state, start, END, noise, steps, sampling, _NEVER)
        texts = [self._text(row[:c].tolist()) for row, c in zip(words, count, strict=True)]
        return [texts[i * n : (i + 1) * n] for i in range(len(seeds))]

    def _text(self, words: list[int]) -> str:
        return self.context.vocabulary.decode(np.array(words, dtype=np.int64))
