"""Motions of texts with a trained TEMOS: durations, latents, decoding, and texts mixed in the latent."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from motionary.errors import InputError, check_whole
from motionary.language import Sentence
from motionary.language.frozen import token_ids, token_states
from motionary.language.text import LONGEST_PROMPT
from motionary.motion import Motion, resample
from motionary.nn.gaussian import Gaussian
from motionary.nn.noise import normal_noise
from motionary.nn.padding import pad
from motionary.systems.protocols import DrawLengths
from motionary.systems.requests import check_frames, check_seeds
from motionary.systems.temos.temos import Temos


class TemosGenerator:
    """Generates motions with a trained :class:`Temos`. Results never depend on the other texts of the call.

    Args:
        model: trained.
        lengths: draws durations that are not given.
        chunk: most motions of a forward pass.
    """

    takes_lengths = True

    def __init__(self, model: Temos, lengths: DrawLengths, chunk: int = 64):
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
    ) -> list[Motion]:
        """A motion for each sentence at the corpus's rate, as :meth:`TextToMotion.generate` says.

        Args:
            frames: where not given, text2length draws them.
            temperature: factor on the standard deviation of z.
            greedy: the likeliest length and z at its mean (the row "z = 0" of the evaluation).
            unused: options of systems that write tokens (top_k, top_p, guidance).
        """
        check_seeds(sentences, seeds)
        if temperature is not None and not temperature > 0:
            raise InputError("temperature", temperature, "must be above 0 (for the likeliest motion use greedy)")
        wanted = self._durations(sentences, seeds, frames, greedy)
        if not sentences:
            return []
        found, scale = self.latents(sentences), self.model.config.temperature if temperature is None else temperature
        z = found.mean
        if not (greedy or self.model.config.deterministic):
            z = found.sample(scale * normal_noise(seeds, 1, z.shape[-1])[:, 0].to(z.device))
        return self.decode(z, wanted)

    def _durations(
        self, sentences: Sequence[Sentence], seeds: Sequence[int], frames: Sequence[int] | None, greedy: bool
    ) -> list[int]:
        drawn = self.lengths(sentences, seeds, greedy) if frames is None else frames
        return check_frames(self.context, sentences, drawn)

    @torch.no_grad()
    def latents(self, sentences: Sequence[Sentence]) -> Gaussian:
        """phi^T of each sentence, (N, latent)."""
        texts = [self.context.vocabulary.mended(sentence) for sentence in sentences]
        for text in texts:
            if len(text) > LONGEST_PROMPT:
                rule = f"must have at most {LONGEST_PROMPT} characters, has {len(text)}"
                raise InputError("text", text, rule)
        config, device = self.model.config, self.model.normalizer.mean.device
        model, rows = config.language_model or None, []
        for start in range(0, len(texts), self.chunk):
            part = texts[start : start + self.chunk]
            read = token_ids(part, model) if config.fine_tune else token_states(part, model, str(device))
            padded, count = pad(read, read[0].dtype)
            rows.append(self.model.encode_text(padded.to(device), count.to(device)))
        return Gaussian(*(torch.cat(values) for values in zip(*rows, strict=True)))

    @torch.no_grad()
    def decode(self, z: Tensor, frames: Sequence[int]) -> list[Motion]:
        """Motions of latents (N, latent), each of `frames` at the corpus's rate."""
        config, fps = self.model.config, self.context.fps
        # As many own frames as reach the last of the corpus's.
        own = [math.ceil((count - 1) * config.fps / fps - 1e-6) + 1 for count in frames]
        motions: list[Motion | None] = [None] * len(frames)
        order = np.argsort(own, kind="stable")[::-1]
        for start in range(0, len(order), self.chunk):
            rows = order[start : start + self.chunk].tolist()
            lengths = torch.tensor([own[i] for i in rows], device=z.device)
            made = self.model.decode(z[rows], lengths).float().cpu().numpy()
            for row, features in zip(rows, made, strict=True):
                motion = self.model.codec.decode(features[: own[row]], fps=config.fps)
                motions[row] = _held(resample(motion, fps), frames[row])
        return motions  # type: ignore[return-value]

    @torch.no_grad()
    def blend(
        self, first: Sentence, second: Sentence, steps: int = 5, frames: int | None = None, seed: int = 0,
        greedy: bool = False,
    ) -> list[Motion]:  # fmt: skip
        """`steps` motions from one text to another, on a straight line between their latents (supplementary video).

        Both ends take the same noise, and all motions the same length, so that only the text changes.

        Raises:
            InputError: fewer than 2 steps, or a length out of range.
        """
        check_whole("steps", steps, 2)
        (length,) = self._durations([first], [seed], None if frames is None else [frames], greedy)
        found = self.latents([first, second])
        z = found.mean
        if not (greedy or self.model.config.deterministic):
            noise = normal_noise([seed, seed], 1, z.shape[-1])[:, 0].to(z.device)
            z = found.sample(self.model.config.temperature * noise)
        share = torch.linspace(0, 1, steps, device=z.device)[:, None]
        return self.decode(z[:1] + share * (z[1:] - z[:1]), [length] * steps)


def _held(motion: Motion, frames: int) -> Motion:
    """Exactly so many frames; where rounding left one too few, the last is repeated."""
    if motion.frames >= frames:
        return motion.crop(0, frames)
    index = np.minimum(np.arange(frames), motion.frames - 1)
    rotations = None if motion.rotations is None else motion.rotations[index]
    return Motion(motion.positions[index], motion.fps, motion.skeleton, rotations)
