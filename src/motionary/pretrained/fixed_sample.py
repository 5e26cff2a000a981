"""A fixed sample of test windows, by which packaged weights are scored wherever they are installed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from motionary.corpus.store import Corpus
from motionary.dictionary import Dictionary
from motionary.errors import InputError
from motionary.files import readable
from motionary.metrics import r_precision
from motionary.motion import Motion, Skeleton
from motionary.systems.registry import EMBED, MOTION_TO_TEXT, TEXT_TO_MOTION

LARGEST = 32  # as the pools in which the papers rank
ROWS = {"real": "real motions", "generated": "generated for the same captions", "captions": "captions of the motions"}


@dataclass(frozen=True)
class FixedSample:
    """Motions of the test split, on one skeleton and at one rate, with a caption each."""

    motions: tuple[Motion, ...]
    texts: tuple[str, ...]

    @classmethod
    def of(cls, corpus: Corpus, seed: int = 0) -> FixedSample:
        """At most 32 captioned test windows, drawn by `seed`, captions of people first and no caption twice.

        Raises:
            InputError: fewer than four of them.
        """
        rows = np.random.default_rng(seed).permutation(corpus.rows("test", captioned=True))
        first = corpus.caption_start[rows]
        order = np.argsort(~corpus.captions.human[first].astype(bool), kind="stable")
        _, places = np.unique(corpus.captions.key[first[order]], return_index=True)
        chosen = rows[order][np.sort(places)][:LARGEST]
        if len(chosen) < 4:
            raise InputError(corpus.folder, len(chosen), "must have at least 4 different captions in its test split")
        texts = (str(corpus.captions.text[corpus.caption_start[row]]) for row in chosen)
        return cls(tuple(corpus.motion(row) for row in chosen), tuple(texts))

    def save(self, path: Path) -> None:
        """As .npz: joints of all motions one after the other, frames of each, texts, rate and skeleton's name."""
        first = self.motions[0]
        np.savez_compressed(
            path,
            positions=np.concatenate([motion.positions for motion in self.motions]),
            frames=np.array([motion.frames for motion in self.motions]),
            texts=np.array(self.texts),
            fps=np.array(first.fps),
            skeleton=np.array(first.skeleton.name),
        )

    @classmethod
    def load(cls, path: Path) -> FixedSample:
        """Reads what :meth:`save` wrote."""
        with np.load(readable(path), allow_pickle=False) as found:
            skeleton, fps = Skeleton.named(str(found["skeleton"])), float(found["fps"])
            joints = np.split(found["positions"], np.cumsum(found["frames"])[:-1])
            motions = tuple(Motion(positions, fps, skeleton) for positions in joints)
            return cls(motions, tuple(map(str, found["texts"])))

    def scores(self, dictionary: Dictionary) -> dict[str, dict[str, list[float]]]:
        """R-precision at 1 to 3 among the sample, by each judge: {judge: {"real", "generated", "captions"}}.

        Real motions and, where the dictionary makes them, generated ones (seed 0) are ranked by their captions; the
        captions that the dictionary gives the motions rank the motions.
        """
        made = self._generated(dictionary)
        captions = self._captions(dictionary)
        found = {}
        for judge in dictionary.offering(EMBED):
            texts = dictionary.embed(list(self.texts), system=judge)
            real = dictionary.embed(motions=list(self.motions), system=judge)
            found[judge] = {"real": _ranked(texts, real)}
            if made:
                found[judge]["generated"] = _ranked(texts, dictionary.embed(motions=made, system=judge))
            if captions:
                found[judge]["captions"] = _ranked(dictionary.embed(captions, system=judge), real)
        return found

    def _generated(self, dictionary: Dictionary) -> list[Motion]:
        if not dictionary.offering(TEXT_TO_MOTION):
            return []
        return [motion for (motion,) in dictionary.generate(list(self.texts))]

    def _captions(self, dictionary: Dictionary) -> list[str]:
        """What is said of each motion; a captioner that says nothing of it says what holds for all."""
        if not dictionary.offering(MOTION_TO_TEXT):
            return []
        return [text or "a person" for (text,) in dictionary.caption(list(self.motions))]


def _ranked(texts: np.ndarray, motions: np.ndarray) -> list[float]:
    return [round(float(value), 4) for value in r_precision(texts, motions, top_k=3, pool=len(texts))]


def judges_rows(scores: dict[str, dict[str, list[float]]]) -> Sequence[tuple[str, str, list[float]]]:
    """Judge, what is judged, and R@1 to R@3, for a table."""
    return [(judge, ROWS[key], values) for judge, rows in scores.items() for key, values in rows.items()]
