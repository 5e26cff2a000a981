"""Motions from sentences, and from parts of motions, with a trained masked autoregression over snippet codes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from motionary.errors import InputError
from motionary.language import Sentence, TextStates
from motionary.nn.layers import length_mask
from motionary.nn.noise import normal_noise
from motionary.nn.padding import by_length, pad
from motionary.systems.codec import BatchedCodec
from motionary.systems.masked.flow_head import flow
from motionary.systems.masked.masked_autoregression import MaskedAutoregression
from motionary.systems.masked.masking import masked_counts
from motionary.systems.masked.motion_filler import NOTHING, DrawLengths
from motionary.systems.masked.text_guidance import TextGuidance, text_of
from motionary.systems.requests import check_frames, check_seeds, chosen_guidance


@dataclass(frozen=True)
class _Drawing:
    """How codes are drawn: factor on the noise that they flow from, and scale of classifier-free guidance."""

    temperature: float
    guidance: float


class SnippetGenerator:
    """Generates and completes motions. Results never depend on the other motions of the call.

    Args:
        model: trained.
        lengths: draws durations that are not given.
        chunk: most motions of a pass.
    """

    takes_lengths = True

    def __init__(self, model: MaskedAutoregression, lengths: DrawLengths, chunk: int = 32):
        self.model, self.lengths, self.chunk = model.eval(), lengths, chunk
        self.context, self.device = model.context, str(model.mean.device)
        self.codec = BatchedCodec(model, self.device, chunk)
        self.states = TextStates(self.device)

    def generate(
        self,
        sentences: Sequence[Sentence],
        seeds: Sequence[int],
        frames: Sequence[int] | None = None,
        **options: float,
    ) -> list[np.ndarray]:
        """Raw features (T, D) for each sentence, as :meth:`TextToMotion.generate` says; without `frames` text2length
        draws them.

        Args:
            options: temperature, a factor on the noise that codes flow from; guidance, 1 is off; greedy, the likeliest
                length and codes from no noise. Those of systems that write tokens (top_k, top_p) change nothing.
        """
        self._drawing(**options)
        check_seeds(sentences, seeds)
        drawn = self.lengths(sentences, seeds, bool(options.get("greedy"))) if frames is None else frames
        wanted, unit = check_frames(self.context, sentences, drawn), self.context.unit
        empty = [np.zeros((-(-count // unit), self.model.config.told), np.float32) for count in wanted]
        unknown = [np.zeros(len(codes), bool) for codes in empty]
        made = self.decode(self.infill(empty, unknown, sentences, seeds, **options))
        return [motion[:count].copy() for motion, count in zip(made, wanted, strict=True)]

    def encode(self, features: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Components (T // unit, told) of the snippet codes of raw features (T, D) of each motion."""
        return self.codec.encode(features)

    @torch.no_grad()
    def infill(
        self,
        tokens: Sequence[np.ndarray],
        known: Sequence[np.ndarray],
        sentences: Sequence[Sentence | None],
        seeds: Sequence[int],
        **options: float,
    ) -> list[np.ndarray]:
        """Components (S, told) of each motion, as :meth:`MotionInfiller.infill` says of tokens."""
        drawing = self._drawing(**options)
        check_seeds(sentences, seeds)  # type: ignore[arg-type]
        self._check(tokens, known, sentences)
        results: list[np.ndarray] = [np.zeros(0)] * len(tokens)
        for rows in by_length([len(codes) for codes in tokens], self.chunk):
            codes, count = (x.to(self.device) for x in pad([tokens[i] for i in rows]))
            fixed = pad([known[i] for i in rows], bool)[0].to(self.device)
            # The last column tells the order of the places, the same whatever the length.
            noise = normal_noise([seeds[i] for i in rows], self.context.max_tokens, self.model.config.told + 1)
            guided = self._guided([sentences[i] for i in rows], drawing.guidance)
            filled = self._fill(guided, codes, fixed, count, noise.to(self.device), drawing.temperature).cpu().numpy()
            for row, i in enumerate(rows):
                results[i] = filled[row, : len(tokens[i])].copy()
        return results

    @torch.no_grad()
    def decode(self, tokens: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Raw features (unit S, D) float32 of the components (S, told) of each motion."""
        motions: list[np.ndarray] = [np.zeros(0)] * len(tokens)
        for rows in by_length([len(codes) for codes in tokens], self.chunk):
            codes, count = (x.to(self.device) for x in pad([tokens[i] for i in rows]))
            decoded = self.model.decode(codes, count).float().cpu().numpy()
            for row, i in enumerate(rows):
                motions[i] = decoded[row, : len(tokens[i]) * self.context.unit].copy()
        return motions

    def _guided(self, sentences: Sequence[Sentence | None], guidance: float) -> TextGuidance:
        """Passes with the sentences, where there are any, and without."""
        has_text = torch.tensor([sentence is not None for sentence in sentences]).to(self.device)
        text = text_of([sentence or NOTHING for sentence in sentences], self.context, self.states, self.device)
        return TextGuidance(self.model.text, self.model.reader, text, has_text, guidance)

    def _fill(
        self, guided: TextGuidance, codes: Tensor, known: Tensor, count: Tensor, noise: Tensor, temperature: float
    ) -> Tensor:
        """Codes (B, S, told): each pass draws some of the places that are left, in a random order (as MAR)."""
        model, steps = self.model, codes.shape[1]
        noise, order = noise[:, :steps, :-1], noise[:, :steps, -1]
        valid = length_mask(count, steps)
        hidden = valid & ~known
        codes, missing = torch.where((valid & known)[..., None], codes, 0.0), hidden.sum(1)
        rank = order.masked_fill(~hidden, torch.inf).argsort(1).argsort(1)
        for step in range(model.config.iterations):
            now = hidden & (rank >= masked_counts(missing, (step + 1) / model.config.iterations)[:, None])
            if not bool(now.any()):
                continue
            embedded = guided.both(model.embed(codes, valid & ~hidden))
            told = model.reader(embedded, guided.both(count), guided.memory, guided.read)[guided.both(now)]

            def velocity(x: Tensor, time: Tensor, told: Tensor = told) -> Tensor:
                """Guided by the text."""
                return guided.mixed(model.head(guided.both(x), guided.both(time), told))

            codes[now] = flow(velocity, temperature * noise[now], model.config.flow_steps).to(codes)
            hidden = hidden & ~now
        return codes

    def _drawing(
        self, temperature: float | None = None, guidance: float | None = None, greedy: float = False, **unused: float
    ) -> _Drawing:
        """The config's way of drawing with these options; InputError for one out of range."""
        if temperature is not None and not 0 < temperature <= 1000:
            raise InputError("temperature", temperature, "must be above 0, at most 1000")
        warmth = self.model.config.temperature if temperature is None else temperature
        return _Drawing(0.0 if greedy else warmth, chosen_guidance(self.model.config, guidance))

    def _check(
        self, tokens: Sequence[np.ndarray], known: Sequence[np.ndarray], sentences: Sequence[Sentence | None]
    ) -> None:
        """InputError for the first motion whose codes no model could have."""
        told, most = self.model.config.told, self.context.max_tokens
        if not len(tokens) == len(known) == len(sentences):
            counts = (len(tokens), len(known), len(sentences))
            raise InputError("tokens, known, sentences", counts, "must be one each for every motion")
        for number, (codes, fixed) in enumerate(zip(tokens, known, strict=True)):
            if codes.ndim != 2 or codes.shape[1] != told or not 1 <= len(codes) <= most:
                raise InputError(f"tokens[{number}]", codes.shape, f"must be (S, {told}) with S in 1..{most}")
            if fixed.shape != codes.shape[:1] or fixed.dtype != bool:
                raise InputError(f"known[{number}]", (fixed.dtype, fixed.shape), f"must be bool ({len(codes)},)")
            if not np.isfinite(codes[fixed]).all():
                raise InputError(f"tokens[{number}]", "not finite", "known codes must be finite")
