"""Motions from sentences, and from parts of motions, with a trained masked generator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from torch import Tensor

from motionary.errors import InputError
from motionary.language import Sentence
from motionary.nn.decoding import Sampling
from motionary.nn.noise import uniform_noise
from motionary.nn.residual_quantizer import NO_CODE
from motionary.systems.masked.examples import POOL
from motionary.systems.masked.filler import Filler
from motionary.systems.masked.mask_decoding import Drawing, draws_needed, fill
from motionary.systems.masked.masked_generator import MaskedGenerator
from motionary.systems.masked.residual_tokenizer import ResidualTokenizer
from motionary.systems.protocols import DrawLengths
from motionary.systems.requests import chosen_guidance


class MotionFiller(Filler):
    """Fills in residual tokens (S, layers).

    Args:
        model: trained.
        tokenizer: whose tokens it tells.
        lengths: draws durations that are not given.
        chunk: most motions of a pass.
    """

    kind = np.int64

    def __init__(self, model: MaskedGenerator, tokenizer: ResidualTokenizer, lengths: DrawLengths, chunk: int = 32):
        super().__init__(tokenizer, model.config.num_quantizers, lengths, str(model.codebooks.device), chunk)
        self.model, self.tokenizer, self.context = model.eval(), tokenizer, model.context

    def fill(
        self,
        sentences: Sequence[Sentence | None],
        seeds: Sequence[int],
        codes: Tensor,
        known: Tensor,
        count: Tensor,
        drawing: Drawing,
    ) -> Tensor:
        """Tokens by the plan and the detail, with examples where the model has any."""
        noise = uniform_noise(seeds, draws_needed(self.model) + POOL)
        noise, of_examples = noise[:, :-POOL], noise[:, -POOL:]
        text, has_text = self.read(sentences)
        text = replace(text, examples=self.model.examples(text.states, text.state_count, of_examples))
        return fill(self.model, text, has_text, codes, known, count, noise, drawing)

    def drawing(self, options: Mapping[str, float]) -> Drawing:
        """The config's way of drawing with these options; InputError for one out of range."""
        config = self.model.config
        given = {name: value for name, value in options.items() if value is not None}
        guidance = chosen_guidance(config, given.get("guidance"))
        sampling = Sampling(
            given.get("temperature", config.temperature), int(given.get("top_k", 0)), given.get("top_p", config.top_p)
        )
        detail = Sampling(config.detail_temperature, top_p=sampling.top_p) if config.detail_temperature else None
        if given.get("greedy"):
            return Drawing(None, guidance, None, config.detail_guidance)
        return Drawing(sampling, guidance, detail, config.detail_guidance)

    def check_known(self, name: str, codes: np.ndarray) -> None:
        """InputError for a number that is no code; finer layers may be without one."""
        config = self.model.config
        least = np.where(np.arange(codes.shape[1]) < config.layers, 0, NO_CODE)
        wrong = np.argwhere((codes < least) | (codes >= config.codebook_size))
        if len(wrong):
            place, layer = wrong[0]
            rule = f"must be codes in {least[layer]}..{config.codebook_size - 1}"
            raise InputError(name, codes[place, layer], rule)
