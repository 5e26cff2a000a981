"""What systems offer, as types. Features are raw, (T, D) float32, of the corpus's codec (see `corpus.context`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from motionary.corpus.context import Context
from motionary.corpus.store import Corpus
from motionary.language import Sentence
from motionary.motion import Motion

if TYPE_CHECKING:  # the page and the shell look offers up without torch
    from torch import Tensor

# What a generator hands out: features of the corpus's codec, or, where a system has features of its own, a Motion.
Made = np.ndarray | Motion
# What sampling can be told, and of what kind; a system may ignore some.
SAMPLING = {"temperature": float, "top_k": int, "top_p": float, "guidance": float, "greedy": bool}
# Frames for sentences and seeds; the likeliest where asked for.
DrawLengths = Callable[[Sequence[Sentence], Sequence[int], bool], Sequence[int]]


class TextToMotion(Protocol):
    """Motions from sentences. No result depends on the other texts of the call (but for retrieval, which draws nothing:
    where a text repeats it hands out the next nearest).

    Attributes:
        context: of the corpus that it learned from.
        takes_lengths: it makes motions as long as it is told, and does not only cut what it found.
    """

    context: Context
    takes_lengths: bool

    def generate(
        self,
        sentences: Sequence[Sentence],
        seeds: Sequence[int],
        frames: Sequence[int] | None = None,
        **options: float,
    ) -> Sequence[Made]:
        """A motion for each sentence.

        Args:
            sentences: normalized texts.
            seeds: one per sentence; equal sentence, seed and options give an equal motion.
            frames: lengths to hold, from one unit to the longest window; otherwise the system decides.
            options: of the system: temperature, top_k, top_p, guidance, greedy.

        Returns:
            raw features (T, D) float32 of each motion, or a `Motion` each; never empty.
        """
        ...


class TextBlender(Protocol):
    """Motions between two texts; `context` is of the corpus that it learned from."""

    context: Context

    def blend(
        self,
        first: Sentence,
        second: Sentence,
        steps: int = 5,
        frames: int | None = None,
        seed: int = 0,
        greedy: bool = False,
    ) -> Sequence[Made]:
        """`steps` motions of one length, the first of one text, the last of the other."""
        ...


class MotionToText(Protocol):
    """Captions of motions.

    Attributes:
        context: of the corpus that it learned from.
        draws: it can choose a caption by consensus of draws.
        written: it writes words as people do, and not normalized ones.
        sources: of captions whose wordings it tells apart, the usual one first; none where it knows one.
    """

    context: Context
    draws: bool
    written: bool
    sources: tuple[str, ...]

    def caption(
        self,
        features: Sequence[np.ndarray],
        beams: int = 2,
        n: int = 1,
        seeds: Sequence[int] | None = None,
        temperature: float | None = None,
        consensus: int = 0,
        source: str | None = None,
        quick: bool = False,
    ) -> list[list[str]]:
        """n captions for each motion.

        Args:
            features: raw features (T, D) of each motion.
            beams: of beam search, which is used unless `temperature` is given (TM2T 4.3: 2).
            n: captions per motion, best first.
            seeds: one per motion, of whatever is drawn for it (0 where not given).
            temperature: draw the captions at this temperature instead.
            consensus: number of captions to draw; the answer is the one that agrees best with all of them (minimum
                Bayes risk). 0 is beam search alone (the paper's).
            source: whose wording, one of `sources`; None is the usual one.
            quick: do as little work as possible: use one network of several, and read a motion once.

        Returns:
            for each motion, its captions: words joined by spaces, normalized or as people write them.
        """
        ...


class MotionCodec(Protocol):
    """Motions to codes and back, in batches; a network."""

    context: Context

    def to(self, device: str) -> MotionCodec:
        """The codec on a device."""
        ...

    def eval(self) -> MotionCodec:
        """The codec in evaluation mode."""
        ...

    def encode(self, raw: Tensor, frames: Tensor) -> Tensor:
        """raw (B, T, D), frames (B,) -> codes (B, T // unit, ...)."""
        ...

    def decode(self, codes: Tensor, count: Tensor) -> Tensor:
        """codes, valid codes (B,) -> raw features (B, T, D)."""
        ...


class TextToLength(Protocol):
    """How long motions of a text are."""

    def distribution(self, sentences: Sequence[Sentence]) -> np.ndarray:
        """(N, T_max) probabilities of lengths of 1 to T_max units."""
        ...

    def sample(
        self, sentences: Sequence[Sentence], seeds: Sequence[int], likeliest: bool = False, temperature: float = 1.0
    ) -> list[int]:
        """Frames for each sentence, whole units, drawn by its seed or the likeliest."""
        ...


class TextMotionJudge(Protocol):
    """Texts and motions in one space, where matching ones are near.

    Attributes:
        context: of the corpus that it learned from.
        hash: names its weights.
        batch_size: items of a forward pass.
    """

    context: Context
    hash: str
    batch_size: int

    def motions(self, features: Sequence[np.ndarray], progress: str | None = None) -> np.ndarray:
        """(N, E) features of motions."""
        ...

    def sentences(self, sentences: Sequence[Sentence]) -> np.ndarray:
        """(N, E) features of sentences."""
        ...


class MotionStylizer(Protocol):
    """Motions in other styles. A setting is "supervised" (labels) or "unsupervised" (references, or draws alone).

    Attributes:
        context: of the corpus that it learned from.
        styles: known labels; a label id is a position in them.
    """

    context: Context
    styles: tuple[str, ...]

    def model(self, setting: str) -> Any:
        """The network of a setting, whose ``config.style_dim`` is the length of a style code; InputError where it was
        not trained."""
        ...

    def stylize(
        self,
        contents: Sequence[np.ndarray],
        *,
        setting: str,
        seeds: Sequence[int],
        labels: Sequence[int] | None = None,
        references: Sequence[np.ndarray] | None = None,
        strength: float = 1.0,
    ) -> Sequence[Made]:
        """Each content in a style: of its label, of its reference, or drawn by its seed; as long as the content."""
        ...

    def style_codes(self, motions: Sequence[np.ndarray], *, setting: str) -> np.ndarray:
        """(N, E) float32 style codes of motions."""
        ...

    def style(self, codes: Tensor, labels: Sequence[int] | None, setting: str) -> Tensor:
        """(N, W) styles of codes (N, E), which may be mixed linearly."""
        ...

    def generate(self, contents: Sequence[np.ndarray], style: Tensor, *, setting: str) -> Sequence[Made]:
        """Each content in the style of its row (N, W)."""
        ...


class StyleClassifier(Protocol):
    """Style and content (action) of motions.

    Attributes:
        hash: names its weights.
    """

    hash: str

    @property
    def trained(self) -> bool:
        """There were style labels to learn from."""
        ...

    def style(self, features: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Logits (N, styles) and features (N, dim) of unit length."""
        ...

    def content(self, features: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Logits (N, actions) and features (N, dim) of unit length."""
        ...


class MotionIndex(Protocol):
    """Features of every window of a corpus, (N, E) float32, and the name of the judge whose they are."""

    motions: np.ndarray
    judge: str


class CorpusSearch(Protocol):
    """Windows of a corpus by meaning."""

    corpus: Corpus
    judge: TextMotionJudge
    index: MotionIndex

    def search(self, sentences: Sequence[Sentence], k: int = 5) -> np.ndarray:
        """(N, k) rows of the corpus, nearest first."""
        ...
