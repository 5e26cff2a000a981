"""Motions from sentences, and from parts of motions, with a trained masked autoregression over snippet codes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from motionary.errors import InputError
from motionary.language import Sentence
from motionary.nn.layers import length_mask
from motionary.nn.noise import normal_noise
from motionary.systems.masked.filler import Filler
from motionary.systems.masked.flow_head import flow
from motionary.systems.masked.masked_autoregression import MaskedAutoregression
from motionary.systems.masked.masking import masked_counts
from motionary.systems.masked.text_guidance import TextGuidance
from motionary.systems.protocols import DrawLengths
from motionary.systems.requests import chosen_guidance


@dataclass(frozen=True)
class FlowDrawing:
    """How codes are drawn: factor on the noise that they flow from, and scale of classifier-free guidance."""

    temperature: float
    guidance: float


class SnippetGenerator(Filler):
    """Fills in the components of snippet codes (S, told).

    Args:
        model: trained.
        lengths: draws durations that are not given.
        chunk: most motions of a pass.
    """

    kind = np.float32

    def __init__(self, model: MaskedAutoregression, lengths: DrawLengths, chunk: int = 32):
        super().__init__(model, model.config.told, lengths, str(model.mean.device), chunk)
        self.model = model.eval()

    @torch.no_grad()
    def fill(
        self,
        sentences: Sequence[Sentence | None],
        seeds: Sequence[int],
        codes: Tensor,
        known: Tensor,
        count: Tensor,
        drawing: FlowDrawing,
    ) -> Tensor:
        """Each pass draws some of the places that are left, in a random order (as MAR)."""
        model, steps = self.model, codes.shape[1]
        guided = TextGuidance(model.text, model.reader, *self.read(sentences), drawing.guidance)
        # The last column tells the order of the places, the same whatever the length; greedy has one for all seeds.
        drawn = seeds if drawing.temperature else [0] * len(seeds)
        noise = normal_noise(drawn, self.context.max_tokens, self.width + 1)[:, :steps].to(self.device)
        valid = length_mask(count, steps)
        hidden = valid & ~known
        codes, missing = torch.where((valid & known)[..., None], codes, 0.0), hidden.sum(1)
        rank = noise[..., -1].masked_fill(~hidden, torch.inf).argsort(1).argsort(1)
        for step in range(model.config.iterations):
            now = hidden & (rank >= masked_counts(missing, (step + 1) / model.config.iterations)[:, None])
            if not bool(now.any()):
                continue
            embedded = guided.both(model.embed(codes, valid & ~hidden))
            told = model.reader(embedded, guided.both(count), guided.memory, guided.read)[guided.both(now)]

            def velocity(x: Tensor, time: Tensor, told: Tensor = told) -> Tensor:
                """Guided by the text."""
                return guided.mixed(model.head(guided.both(x), guided.both(time), told))

            start = drawing.temperature * noise[now][:, :-1]
            codes[now] = flow(velocity, start, model.config.flow_steps).to(codes)
            hidden = hidden & ~now
        return codes

    def drawing(self, options: Mapping[str, float]) -> FlowDrawing:
        """The config's way of drawing with these options: temperature, a factor on the noise that codes flow from;
        guidance, 1 is off; greedy, no noise and one order of the places. Those of systems that write tokens (top_k,
        top_p) change nothing."""
        config, temperature = self.model.config, options.get("temperature")
        if temperature is not None and not 0 < temperature <= 1000:
            raise InputError("temperature", temperature, "must be above 0, at most 1000")
        warmth = config.temperature if temperature is None else temperature
        return FlowDrawing(0.0 if options.get("greedy") else warmth, chosen_guidance(config, options.get("guidance")))

    def check_known(self, name: str, codes: np.ndarray) -> None:
        """InputError for a code that is not finite."""
        if not np.isfinite(codes).all():
            raise InputError(name, "not finite", "known codes must be finite")
