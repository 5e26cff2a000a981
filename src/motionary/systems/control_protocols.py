"""What systems offer that make a part of a motion anew, as types; see :mod:`motionary.systems.protocols`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from motionary.corpus.context import Context
from motionary.language import Sentence


class MotionInfiller(Protocol):
    """Motions of which some tokens are known: the others are made, with a text or without.

    A token stands for `context.unit` frames; a motion has at most `context.max_tokens` of them.

    Attributes:
        context: of the corpus that it learned from.
    """

    context: Context

    def encode(self, features: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Tokens (T // unit, ...) of raw features (T, D) of each motion."""
        ...

    def infill(
        self,
        tokens: Sequence[np.ndarray],
        known: Sequence[np.ndarray],
        sentences: Sequence[Sentence | None],
        seeds: Sequence[int],
        **options: float,
    ) -> list[np.ndarray]:
        """Tokens of each motion, those that were known unchanged.

        Args:
            tokens: (S, ...) as of `encode`; what stands at unknown places is not read.
            known: (S,) bool of each.
            sentences: what each motion shall show; None says nothing.
            seeds: one each; equal tokens, sentence, seed and options give equal tokens, whatever else the call has.
            options: of the system: temperature, top_k, top_p, guidance, greedy.

        Raises:
            InputError: shapes that do not fit, no token, or more than `context.max_tokens`.
        """
        ...

    def decode(self, tokens: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Raw features (unit S, D) float32 of the tokens (S, ...) of each motion."""
        ...
