"""Motions from sentences with a trained temporal VAE: lengths, latent draws, decoding."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch

from motionary.errors import InputError
from motionary.language import Sentence
from motionary.nn.noise import normal_noise
from motionary.systems.protocols import DrawLengths
from motionary.systems.requests import check_frames, check_seeds, encode_sentences
from motionary.systems.t2m.text2motion import Text2Motion


class MotionGenerator:
    """Generates motions with a trained :class:`Text2Motion`. Results never depend on the other texts of the call."""

    takes_lengths = True

    def __init__(self, model: Text2Motion, lengths: DrawLengths, chunk: int = 128):
        self.model, self.lengths, self.chunk = model.eval(), lengths, chunk
        self.context = model.context

    @torch.no_grad()
    def generate(
        self,
        sentences: Sequence[Sentence],
        seeds: Sequence[int],
        frames: Sequence[int] | None = None,
        temperature: float | None = None,
        greedy: bool = False,
        **unused: float,
    ) -> list[np.ndarray]:
        """Raw features (T, D) for each sentence, as :meth:`TextToMotion.generate` says.

        Args:
            frames: where not given, text2length draws them.
            temperature: factor on the deviation of the latent draws.
            greedy: the likeliest length and the mean latent in place of draws.
            unused: options of systems that write tokens (top_k, top_p, guidance).
        """
        check_seeds(sentences, seeds)
        if temperature is not None and not temperature > 0:
            raise InputError("temperature", temperature, "must be above 0 (for the likeliest motion use greedy)")
        drawn = self.lengths(sentences, seeds, greedy) if frames is None else frames
        wanted = check_frames(self.context, sentences, drawn)
        scale = self.model.config.temperature if temperature is None else temperature
        results: list[Any] = [None] * len(sentences)
        # Longest first: motions that are finished leave the batch.
        order = np.argsort(wanted, kind="stable")[::-1]
        for start in range(0, len(order), self.chunk):
            rows = order[start : start + self.chunk].tolist()
            chosen = [(sentences[i], seeds[i], wanted[i]) for i in rows]
            for row, motion in zip(rows, self._chunk(chosen, 0.0 if greedy else scale), strict=True):
                results[row] = motion
        return results

    def _chunk(self, chosen: list[tuple[Sentence, int, int]], temperature: float) -> list[np.ndarray]:
        """Motions for (sentence, seed, frames), longest first."""
        model, device = self.model, self.model.first.device
        words = encode_sentences(self.context, [sentence for sentence, _, _ in chosen], device)
        length = torch.tensor([-(-frames // model.stride) for _, _, frames in chosen], device=device)
        noise = normal_noise([seed for _, seed, _ in chosen], int(length[0]), model.config.latent).to(device)
        sentence, hidden = model.net.start(*words)
        codes = model.net.generate(sentence, hidden, model.first, length, noise, temperature)
        motion = model.decode(codes, length).float().cpu().numpy()
        return [row[:frames].copy() for row, (_, _, frames) in zip(motion, chosen, strict=True)]
