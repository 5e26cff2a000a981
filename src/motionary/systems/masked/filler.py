"""What generators have in common that fill in the codes of a motion: from sentences, and from parts of motions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import DTypeLike
from torch import Tensor

from motionary.errors import InputError
from motionary.language import Sentence, TextStates
from motionary.nn.padding import by_length, pad
from motionary.systems.codec import BatchedCodec
from motionary.systems.masked.masked_networks import Text
from motionary.systems.masked.text_guidance import text_of
from motionary.systems.protocols import DrawLengths, MotionCodec
from motionary.systems.requests import check_frames, check_options, check_seeds

_NOTHING = Sentence("", (), ())


class Filler(ABC):
    """Generates and completes motions. Results never depend on the other motions of the call.

    (Matrix products round differently with the number of rows, so that a draw on the very edge between two tokens may
    still fall to the other side.)

    Args:
        coder: between motions and codes.
        width: numbers of a code.
        lengths: draws durations that are not given.
        device: where the models are.
        chunk: most motions of a pass.

    Attributes:
        kind: of the numbers of a code.
    """

    takes_lengths = True
    kind: ClassVar[DTypeLike]

    def __init__(self, coder: MotionCodec, width: int, lengths: DrawLengths, device: str, chunk: int):
        self.context, self.width, self.lengths, self.device, self.chunk = coder.context, width, lengths, device, chunk
        self.codec = BatchedCodec(coder, device, chunk)
        self.states = TextStates(device)

    def generate(
        self,
        sentences: Sequence[Sentence],
        seeds: Sequence[int],
        frames: Sequence[int] | None = None,
        **options: float,
    ) -> list[np.ndarray]:
        """Raw features (T, D) for each sentence, as :meth:`TextToMotion.generate` says; without `frames` text2length
        draws them."""
        self._asked(options)
        check_seeds(sentences, seeds)
        drawn = self.lengths(sentences, seeds, bool(options.get("greedy"))) if frames is None else frames
        wanted, unit = check_frames(self.context, sentences, drawn), self.context.unit
        empty = [np.zeros((-(-count // unit), self.width), self.kind) for count in wanted]
        unknown = [np.zeros(len(codes), bool) for codes in empty]
        made = self.decode(self.infill(empty, unknown, sentences, seeds, **options))
        return [motion[:count].copy() for motion, count in zip(made, wanted, strict=True)]

    def encode(self, features: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Codes (T // unit, width) of raw features (T, D) of each motion."""
        return self.codec.encode(features)

    def infill(
        self,
        tokens: Sequence[np.ndarray],
        known: Sequence[np.ndarray],
        sentences: Sequence[Sentence | None],
        seeds: Sequence[int],
        **options: float,
    ) -> list[np.ndarray]:
        """Codes (S, width) of each motion, as :meth:`MotionInfiller.infill` says."""
        drawing = self._asked(options)
        check_seeds(sentences, seeds)  # type: ignore[arg-type]
        self._check(tokens, known, sentences)
        results: list[np.ndarray] = [np.zeros(0)] * len(tokens)
        for rows in by_length([len(codes) for codes in tokens], self.chunk):
            codes, count = (x.to(self.device) for x in pad([tokens[i] for i in rows], self.kind))
            fixed = pad([known[i] for i in rows], bool)[0].to(self.device)
            told = [sentences[i] for i in rows]
            filled = self.fill(told, [seeds[i] for i in rows], codes, fixed, count, drawing).cpu().numpy()
            for row, i in enumerate(rows):
                results[i] = filled[row, : len(tokens[i])]
        return results

    @torch.no_grad()
    def decode(self, tokens: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Raw features (unit S, D) float32 of the codes (S, width) of each motion."""
        motions: list[np.ndarray] = [np.zeros(0)] * len(tokens)
        for rows in by_length([len(codes) for codes in tokens], self.chunk):
            codes, count = (x.to(self.device) for x in pad([tokens[i] for i in rows], self.kind))
            decoded = self.codec.model.decode(codes, count).float().cpu().numpy()
            for row, i in enumerate(rows):
                motions[i] = decoded[row, : len(tokens[i]) * self.context.unit].copy()
        return motions

    @abstractmethod
    def drawing(self, options: Mapping[str, float]) -> Any:
        """How codes are chosen with these options of a call; InputError for one out of range."""
        ...

    @abstractmethod
    def fill(
        self,
        sentences: Sequence[Sentence | None],
        seeds: Sequence[int],
        codes: Tensor,
        known: Tensor,
        count: Tensor,
        drawing: Any,
    ) -> Tensor:
        """Codes (B, S, width) of which those at `known` (B, S) stay and all others of `count` (B,) are made."""
        ...

    @abstractmethod
    def check_known(self, name: str, codes: np.ndarray) -> None:
        """InputError, which calls them `name`, for known codes (K, width) that no model could have."""
        ...

    def _asked(self, options: Mapping[str, float]) -> Any:
        """`drawing`; InputError for an option that sampling does not have too."""
        check_options(options)
        return self.drawing(options)

    def read(self, sentences: Sequence[Sentence | None]) -> tuple[Text, Tensor]:
        """The sentences as the model reads them, and (B,) where there are any."""
        text = text_of([sentence or _NOTHING for sentence in sentences], self.context, self.states, self.device)
        return text, torch.tensor([sentence is not None for sentence in sentences]).to(self.device)

    def _check(
        self, tokens: Sequence[np.ndarray], known: Sequence[np.ndarray], sentences: Sequence[Sentence | None]
    ) -> None:
        """InputError for the first motion whose codes no model could have."""
        most = self.context.max_tokens
        if not len(tokens) == len(known) == len(sentences):
            counts = (len(tokens), len(known), len(sentences))
            raise InputError("tokens, known, sentences", counts, "must be one each for every motion")
        for number, (codes, fixed) in enumerate(zip(tokens, known, strict=True)):
            if codes.ndim != 2 or codes.shape[1] != self.width or not 1 <= len(codes) <= most:
                raise InputError(f"tokens[{number}]", codes.shape, f"must be (S, {self.width}) with S in 1..{most}")
            if fixed.shape != codes.shape[:1] or fixed.dtype != bool:
                raise InputError(f"known[{number}]", (fixed.dtype, fixed.shape), f"must be bool ({len(codes)},)")
            self.check_known(f"tokens[{number}]", codes[fixed])
