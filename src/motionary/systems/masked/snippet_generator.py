"""Motions from sentences with a trained masked autoregression over snippet codes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from motionary.errors import InputError
from motionary.language import Sentence, TextStates
from motionary.nn.layers import length_mask
from motionary.nn.noise import normal_noise
from motionary.nn.padding import by_length
from motionary.systems.masked.flow_head import flow
from motionary.systems.masked.masked_autoregression import MaskedAutoregression
from motionary.systems.masked.masking import masked_counts
from motionary.systems.masked.motion_filler import DrawLengths
from motionary.systems.masked.text_guidance import TextGuidance, text_of
from motionary.systems.requests import check_frames, check_seeds, chosen_guidance


class SnippetGenerator:
    """Generates motions. Results never depend on the other texts of the call.

    Args:
        model: trained.
        lengths: draws durations that are not given.
        chunk: most motions of a pass.
    """

    takes_lengths = True

    def __init__(self, model: MaskedAutoregression, lengths: DrawLengths, chunk: int = 32):
        self.model, self.lengths, self.chunk = model.eval(), lengths, chunk
        self.context, self.device = model.context, str(model.mean.device)
        self.states = TextStates(self.device)

    @torch.no_grad()
    def generate(
        self,
        sentences: Sequence[Sentence],
        seeds: Sequence[int],
        frames: Sequence[int] | None = None,
        temperature: float | None = None,
        guidance: float | None = None,
        greedy: bool = False,
        **unused: float,
    ) -> list[np.ndarray]:
        """Raw features (T, D) for each sentence, as :meth:`TextToMotion.generate` says.

        Args:
            frames: where not given, text2length draws them.
            temperature: factor on the noise that codes flow from.
            guidance: scale of classifier-free guidance; 1 is off.
            greedy: the likeliest length, and codes from no noise.
            unused: options of systems that write tokens (top_k, top_p).
        """
        config = self.model.config
        check_seeds(sentences, seeds)
        if temperature is not None and not 0 < temperature <= 1000:
            raise InputError("temperature", temperature, "must be above 0, at most 1000")
        scale = chosen_guidance(config, guidance)
        drawn = self.lengths(sentences, seeds, greedy) if frames is None else frames
        wanted = check_frames(self.context, sentences, drawn)
        warmth = 0.0 if greedy else config.temperature if temperature is None else temperature
        results: list[np.ndarray] = [np.zeros(0)] * len(sentences)
        for rows in by_length(wanted, self.chunk):
            count = torch.tensor([-(-wanted[i] // self.context.unit) for i in rows]).to(self.device)
            # The last column tells the order of the places, the same whatever the length.
            noise = normal_noise([seeds[i] for i in rows], self.context.max_tokens, config.told + 1)
            codes = self._draw([sentences[i] for i in rows], count, noise.to(self.device), warmth, scale)
            motions = self.model.decode(codes, count).float().cpu().numpy()
            for row, i in enumerate(rows):
                results[i] = motions[row, : wanted[i]].copy()
        return results

    def _draw(
        self, sentences: Sequence[Sentence], count: Tensor, noise: Tensor, temperature: float, guidance: float
    ) -> Tensor:
        """Codes (B, S, told): each pass draws some of the places that are left, in a random order (as MAR)."""
        model, steps = self.model, int(count.max())
        noise, order = noise[:, :steps, :-1], noise[:, :steps, -1]
        text = text_of(sentences, self.context, self.states, self.device)
        guided = TextGuidance(model.text, model.reader, text, torch.ones_like(count, dtype=torch.bool), guidance)
        valid = hidden = length_mask(count, steps)
        rank = order.masked_fill(~valid, torch.inf).argsort(1).argsort(1)
        codes = torch.zeros_like(noise)
        for step in range(model.config.iterations):
            now = hidden & (rank >= masked_counts(count, (step + 1) / model.config.iterations)[:, None])
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
