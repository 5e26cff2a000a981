"""Motions from sentences with a trained token model: sampling, guidance, decoding by the tokenizer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from motionary.language import Sentence
from motionary.nn.decoding import Decoder, Sampling, sample
from motionary.nn.noise import uniform_noise
from motionary.systems.requests import check_frames, check_options, check_seeds, chosen_guidance, encode_sentences
from motionary.systems.tm2t.text2token import Text2Token, blank
from motionary.systems.tm2t.tokenizer import Tokenizer

# Motions decoded at once: in larger batches the decoder's frames no longer fit a CPU's cache. Tokens are drawn for
# many more at once, since their matrix products have only one row per motion.
DECODED = 32


class Guided:
    """A decoder that moves log-probabilities away from those without text: none + scale (text - none), not normalized.

    Its state is the pair of the decoder's states with and without text.
    """

    def __init__(self, decoder: Decoder, scale: float):
        self.decoder, self.scale = decoder, scale

    def step(self, state: tuple[Any, Any], tokens: Tensor) -> tuple[Tensor, tuple[Any, Any]]:
        """The guided logits after `tokens` (R,), by which both states advance."""
        with_text, first = self.decoder.step(state[0], tokens)
        without, second = self.decoder.step(state[1], tokens)
        with_text, without = with_text.log_softmax(-1), without.log_softmax(-1)
        return without + self.scale * (with_text - without), (first, second)

    def reorder(self, state: tuple[Any, Any], index: Tensor) -> tuple[Any, Any]:
        """Both states with the rows of `index`."""
        return self.decoder.reorder(state[0], index), self.decoder.reorder(state[1], index)


class TokenGenerator:
    """Generates motions with a trained :class:`Text2Token`, `chunk` texts at once.

    Each motion is drawn by its own seed, whatever other texts the call has. (Matrix products round differently with
    the number of rows, so that a draw on the very edge between two tokens may still fall to the other side.)
    """

    takes_lengths = True

    def __init__(self, model: Text2Token, tokenizer: Tokenizer, chunk: int = 512):
        self.model, self.tokenizer, self.chunk = model.eval(), tokenizer, chunk
        self.context = model.context

    @torch.no_grad()
    def generate(
        self,
        sentences: Sequence[Sentence],
        seeds: Sequence[int],
        frames: Sequence[int] | None = None,
        **options: float,
    ) -> list[np.ndarray]:
        """Raw features (T, D) for each sentence, as :meth:`TextToMotion.generate` says; without `frames` the end token
        decides, at most after `max_tokens`."""
        results: list[np.ndarray] = []
        wanted = None if frames is None else check_frames(self.context, sentences, frames)
        check_options(options)
        for first in range(0, len(sentences), self.chunk):
            part = slice(first, first + self.chunk)
            lengths = None if wanted is None else wanted[part]
            results += self._chunk(sentences[part], seeds[part], lengths, options)
        return results

    def tokens(
        self,
        sentences: Sequence[Sentence],
        seeds: Sequence[int],
        lengths: Sequence[int] | None = None,
        temperature: float | None = None,
        top_k: int | None = None,
        top_p: float | None = None,
        guidance: float | None = None,
        greedy: bool = False,
    ) -> tuple[Tensor, Tensor]:
        """Motion tokens (B, S), padded with 0, and counts (B,), at least 1; options as in `generate`.

        All sentences are drawn at once. `lengths` (in tokens) forces the counts.

        Raises:
            InputError: an option out of range, or guidance of a model that never trained without text.
        """
        model, config = self.model, self.model.config
        device = next(model.parameters()).device
        check_seeds(sentences, seeds)
        chosen = Sampling(
            config.temperature if temperature is None else temperature,
            config.top_k if top_k is None else top_k,
            config.top_p if top_p is None else top_p,
        )
        steps = config.max_tokens if lengths is None else max(lengths)
        guidance = chosen_guidance(config, guidance)
        words = encode_sentences(self.context, sentences, device)
        decoder: Decoder = model.net
        state: Any = model.net.start(*words)
        if guidance != 1:
            everything = torch.ones(len(sentences), dtype=torch.bool, device=device)
            decoder, state = Guided(model.net, guidance), (state, model.net.start(*blank(*words, everything)))
        start = torch.full((len(sentences),), model.start_token, device=device)
        forced = None if lengths is None else torch.tensor(lengths, device=device)
        tokens, count = sample(
            decoder, state, start, model.end_token, None if greedy else uniform_noise(seeds, steps), steps, chosen,
            (model.start_token, model.pad_token), forced,
        )  # fmt: skip
        return tokens[:, : int(count.max())].masked_fill(tokens[:, : int(count.max())] == model.end_token, 0), count

    def _chunk(self, sentences, seeds, frames: list[int] | None, options: dict[str, Any]) -> list[np.ndarray]:
        unit = self.context.unit
        lengths = None if frames is None else [-(-f // unit) for f in frames]
        tokens, count = self.tokens(sentences, seeds, lengths, **options)
        ends = (count * unit).tolist() if frames is None else frames
        motions: list[np.ndarray] = [np.zeros(0)] * len(sentences)
        for rows in count.argsort(stable=True).split(DECODED):
            longest = int(count[rows].max())
            decoded = self.tokenizer.decode(tokens[rows, :longest], count[rows]).float().cpu().numpy()
            for row, motion in zip(rows.tolist(), decoded, strict=True):
                motions[row] = motion[: ends[row]].copy()
        return motions
