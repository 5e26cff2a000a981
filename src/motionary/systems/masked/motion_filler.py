"""Motions from sentences, and from parts of motions, with a trained masked generator."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import torch

from motionary.errors import InputError
from motionary.language import Sentence, TextStates
from motionary.nn.decoding import Sampling
from motionary.nn.noise import uniform_noise
from motionary.nn.padding import by_length, pad
from motionary.nn.residual_quantizer import NO_CODE
from motionary.systems.codec import BatchedCodec
from motionary.systems.masked.examples import POOL
from motionary.systems.masked.mask_decoding import Drawing, draws_needed, fill
from motionary.systems.masked.masked_generator import MaskedGenerator
from motionary.systems.masked.masked_networks import Text
from motionary.systems.masked.residual_tokenizer import ResidualTokenizer
from motionary.systems.masked.text_guidance import text_of
from motionary.systems.requests import check_frames, check_seeds, chosen_guidance

# Frames for sentences and seeds; the likeliest where asked for.
DrawLengths = Callable[[Sequence[Sentence], Sequence[int], bool], Sequence[int]]
OPTIONS = ("temperature", "top_k", "top_p", "guidance", "greedy")
NOTHING = Sentence("", (), ())


class MotionFiller:
    """Generates and completes motions. Results never depend on the other motions of the call.

    (Matrix products round differently with the number of rows, so that a draw on the very edge between two tokens may
    still fall to the other side.)

    Args:
        model: trained.
        tokenizer: whose tokens it tells.
        lengths: draws durations that are not given.
        chunk: most motions of a pass.
    """

    takes_lengths = True

    def __init__(self, model: MaskedGenerator, tokenizer: ResidualTokenizer, lengths: DrawLengths, chunk: int = 32):
        self.model, self.lengths, self.chunk = model.eval(), lengths, chunk
        self.context, self.device = model.context, str(model.codebooks.device)
        self.tokenizer = tokenizer.eval()
        self.codec = BatchedCodec(tokenizer, self.device, chunk)
        self.states = TextStates(self.device)

    def generate(
        self,
        sentences: Sequence[Sentence],
        seeds: Sequence[int],
        frames: Sequence[int] | None = None,
        **options: float,
    ) -> list[np.ndarray]:
        """Raw features (T, D) for each sentence, as :meth:`TextToMotion.generate` says; without `frames` text2length
        draws them."""
        self._drawing(options)
        check_seeds(sentences, seeds)
        drawn = self.lengths(sentences, seeds, bool(options.get("greedy"))) if frames is None else frames
        wanted, unit = check_frames(self.context, sentences, drawn), self.context.unit
        empty = [np.zeros((-(-count // unit), self.model.config.num_quantizers), np.int64) for count in wanted]
        unknown = [np.zeros(len(codes), bool) for codes in empty]
        made = self.decode(self.infill(empty, unknown, sentences, seeds, **options))
        return [motion[:count].copy() for motion, count in zip(made, wanted, strict=True)]

    def encode(self, features: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Tokens (T // unit, layers) of raw features (T, D) of each motion."""
        return self.codec.encode(features)

    def infill(
        self,
        tokens: Sequence[np.ndarray],
        known: Sequence[np.ndarray],
        sentences: Sequence[Sentence | None],
        seeds: Sequence[int],
        **options: float,
    ) -> list[np.ndarray]:
        """Tokens (S, layers) of each motion, as :meth:`MotionInfiller.infill` says."""
        drawing = self._drawing(options)
        check_seeds(sentences, seeds)  # type: ignore[arg-type]
        self._check(tokens, known, sentences)
        results: list[np.ndarray] = [np.zeros(0)] * len(tokens)
        for rows in by_length([len(codes) for codes in tokens], self.chunk):
            told = [sentences[i] for i in rows]
            codes, count = pad([tokens[i] for i in rows], np.int64)
            fixed, _ = pad([known[i] for i in rows], bool)
            noise = uniform_noise([seeds[i] for i in rows], draws_needed(self.model) + POOL)
            noise, of_examples = noise[:, :-POOL], noise[:, -POOL:]
            has_text = torch.tensor([sentence is not None for sentence in told]).to(self.device)
            text = self._text([sentence or NOTHING for sentence in told], of_examples)
            codes = codes.to(self.device)
            fixed, count = fixed.to(self.device), count.to(self.device)
            filled = fill(self.model, text, has_text, codes, fixed, count, noise, drawing).cpu().numpy()
            for row, i in enumerate(rows):
                results[i] = filled[row, : len(tokens[i])]
        return results

    @torch.no_grad()
    def decode(self, tokens: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Raw features (unit S, D) float32 of the tokens (S, layers) of each motion."""
        motions: list[np.ndarray] = [np.zeros(0)] * len(tokens)
        for rows in by_length([len(codes) for codes in tokens], self.chunk):
            codes, count = pad([tokens[i] for i in rows], np.int64)
            decoded = self.tokenizer.decode(codes.to(self.device), count.to(self.device)).float().cpu().numpy()
            for row, i in enumerate(rows):
                motions[i] = decoded[row, : len(tokens[i]) * self.context.unit].copy()
        return motions

    def _text(self, sentences: Sequence[Sentence], noise: torch.Tensor) -> Text:
        """The sentences as the model reads them; noise (B, POOL) draws the examples."""
        text = text_of(sentences, self.context, self.states, self.device)
        return replace(text, examples=self.model.examples(text.states, text.state_count, noise))

    def _drawing(self, options: dict[str, float]) -> Drawing:
        """The config's way of drawing with these options; InputError for an unknown one or one out of range."""
        config = self.model.config
        for name, value in options.items():
            if name not in OPTIONS:
                raise InputError(name, value, f"unknown option; known are {', '.join(OPTIONS)}")
        given = {name: value for name, value in options.items() if value is not None}
        guidance = chosen_guidance(config, given.get("guidance"))
        sampling = Sampling(
            given.get("temperature", config.temperature), int(given.get("top_k", 0)), given.get("top_p", config.top_p)
        )
        detail = Sampling(config.detail_temperature, top_p=sampling.top_p) if config.detail_temperature else None
        if given.get("greedy"):
            return Drawing(None, guidance, None, config.detail_guidance)
        return Drawing(sampling, guidance, detail, config.detail_guidance)

    def _check(
        self, tokens: Sequence[np.ndarray], known: Sequence[np.ndarray], sentences: Sequence[Sentence | None]
    ) -> None:
        """InputError for the first motion whose tokens no model could have."""
        config, most = self.model.config, self.context.max_tokens
        if not len(tokens) == len(known) == len(sentences):
            counts = (len(tokens), len(known), len(sentences))
            raise InputError("tokens, known, sentences", counts, "must be one each for every motion")
        for number, (codes, fixed) in enumerate(zip(tokens, known, strict=True)):
            if codes.ndim != 2 or codes.shape[1] != config.num_quantizers or not 1 <= len(codes) <= most:
                rule = f"must be (S, {config.num_quantizers}) with S in 1..{most}"
                raise InputError(f"tokens[{number}]", codes.shape, rule)
            if fixed.shape != codes.shape[:1] or fixed.dtype != bool:
                raise InputError(f"known[{number}]", (fixed.dtype, fixed.shape), f"must be bool ({len(codes)},)")
            held, least = codes[fixed], np.where(np.arange(codes.shape[1]) < config.layers, 0, NO_CODE)
            wrong = np.argwhere((held < least) | (held >= config.codebook_size))
            if len(wrong):
                place, layer = wrong[0]
                rule = f"must be codes in {least[layer]}..{config.codebook_size - 1}"
                raise InputError(f"tokens[{number}]", held[place, layer], rule)
