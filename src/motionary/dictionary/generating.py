"""Motions of texts: what :meth:`motionary.dictionary.Dictionary.generate` asks of a trained pipeline."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from motionary.corpus.context import Context
from motionary.corpus.encoding import as_motion, frames_of, planted
from motionary.dictionary import control
from motionary.dictionary.blending import Blending
from motionary.errors import MOST_ASKED, InputError, check_whole
from motionary.language import Sentence
from motionary.motion import Motion, fit_rotations
from motionary.motion.paths import checked_path
from motionary.systems.protocols import TextToMotion
from motionary.systems.registry import TEXT_TO_MOTION
from motionary.systems.requests import check_options


class Generating(Blending):
    """What a folder's systems make of texts."""

    def generate(
        self,
        texts: str | Sequence[str],
        n: int = 1,
        seconds: float | Sequence[float] | None = None,
        system: str | None = None,
        seed: int = 0,
        feet: bool = True,
        join: bool = False,
        loop: bool = False,
        path: Any = None,
        keyframes: Mapping[float, Motion] | None = None,
        **options: float,
    ) -> list[Any]:
        """Motions that a text describes.

        Args:
            texts: one English text, or several that are generated together.
            n: variants of each text.
            seconds: length, rounded to whole motion tokens (0.2 s at 20 fps), or one for each text; None lets the
                system decide. The longest that systems learn is a little shorter than ten seconds: 10 gives 9.8.
            system: the text-to-motion system that answers; None takes the usual one.
            seed: equal text, variant, seed and options give an equal motion, whatever else is asked with them (but
                for retrieval, which draws nothing: of one call it hands out the nearest, the next nearest, ...).
            feet: let them stand (:meth:`motionary.Motion.plant_feet`); False gives what the system made.
            join: make one motion of all texts, each going on from where the one before ends; at most 20.
            loop: end each motion as it begins, so that it can be repeated.
            path: points (x, z) in metres, from the first to the last of which each motion goes.
            keyframes: poses by seconds, each the first frame of a motion on any rig, where it is; z is ahead.
            options: of sampling: temperature, top_k, top_p, guidance, greedy.

        Returns:
            n motions with rotations, bones of one length each (with `keyframes` positions alone: these are met as they
            are); for several texts that are not joined a list of n motions for each.

        Raises:
            InputError: a text that cannot be read, a value out of range, constraints that contradict each other or
                cannot be met, a system that is not there.
        """
        sentences = self._sentences(texts)
        check_whole("n", n, 1, MOST_ASKED)
        check_whole("seed", seed, 0)
        control.check_one(loop, path, keyframes, join, len(sentences))
        check_options(options)
        generator: TextToMotion = self._open(TEXT_TO_MOTION, system)
        make = partial(self._made, generator, n=n, seed=seed, feet=feet, options=options)
        lengths = each_length(seconds, len(sentences))
        if path is not None and lengths is None and not join:
            rows = [[_paced(make, text, k, path, generator.context) for k in range(n)] for text in sentences]
        else:
            rows = make(sentences, lengths)
        if join:
            rows = [[control.join([row[k] for row in rows], feet) for k in range(n)]]
        asked = (loop, path, keyframes, feet, generator.context)
        rows = [[control.constrained(motion, *asked) for motion in row] for row in rows]
        if not keyframes:  # given poses are met as they are, whatever their bones
            rows = [[fit_rotations(motion) for motion in row] for row in rows]
        return rows[0] if join or isinstance(texts, str) else rows

    def _made(
        self,
        generator: TextToMotion,
        sentences: Sequence[Sentence],
        lengths: Sequence[float] | None,
        *,
        n: int,
        seed: int,
        feet: bool,
        options: Mapping[str, float],
    ) -> list[list[Motion]]:
        """n motions of each text, of so many seconds each."""
        context = generator.context
        frames = None if lengths is None else [frames_of(length, context) for length in lengths for _ in range(n)]
        seeds = [int(np.random.SeedSequence([seed, k]).generate_state(1)[0]) for k in range(n)] * len(sentences)
        with self._lock:
            made = generator.generate([s for s in sentences for _ in range(n)], seeds, frames, **options)
        motions = planted([as_motion(features, context) for features in made], feet)
        return [motions[i : i + n] for i in range(0, len(motions), n)]


def each_length(seconds: Any, texts: int) -> list[float] | None:
    """One length for each text; None where the system decides."""
    if not isinstance(seconds, list | tuple):
        return None if seconds is None else [seconds] * texts
    if len(seconds) != texts:
        raise InputError("seconds", f"{len(seconds)} lengths", f"must be one number, or one for each of {texts} texts")
    return list(seconds)


def _paced(make: Callable[..., list[list[Motion]]], text: Sentence, k: int, path: Any, context: Context) -> Motion:
    """Variant k of a motion that takes as long for a path as its own speed does."""
    shortest, longest = context.unit / context.fps, context.max_frames / context.fps
    line = checked_path(path, longest)
    return control.paced(line, lambda seconds: make([text], [seconds])[0][k], shortest, longest)
