"""A trained pipeline in hand: text to motion, motion to text, search. ``motionary.load("models")`` opens it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from motionary.corpus.encoding import encode, listed, one, planted
from motionary.dictionary.editing import Editing
from motionary.dictionary.matches import Match
from motionary.dictionary.places import usual_models
from motionary.errors import MOST_ASKED, MOST_DRAWS, InputError, check_whole
from motionary.motion import Motion
from motionary.systems.protocols import CorpusSearch, MotionToText
from motionary.systems.registry import ACT, MOTION_TO_TEXT, SEARCH, STYLIZE
from motionary.systems.requests import check_options


def load(models: str | Path | None = None, device: str = "auto") -> Dictionary:
    """Open the models that ``dvc repro`` built, or those that are packaged; each system loads when it is first asked.

    Args:
        models: the folder; any subset of its systems serves. Search also reads ``data/corpus`` beside the folder. None
            takes the folder that $MOTIONARY_MODELS names, else ``models`` here, else the packaged bundle, and says
            which on standard error.
        device: "auto", "cpu", "cuda" or another that torch names.

    Raises:
        InputError: no such folder, or no model in it.

    Example:
        >>> d = motionary.load("models")  # doctest: +SKIP
        >>> d.generate("a person waves", n=3, seed=0)[0].save("wave.bvh")  # doctest: +SKIP
    """
    if models is not None and not isinstance(models, str | os.PathLike):
        raise InputError("models", models, "must be the path of a folder of trained models")
    folder = usual_models() if models is None else Path(models)
    if not os.path.isdir(folder):  # also where the name is longer than names can be
        raise InputError(folder, "missing", "must be a folder of trained models; run `dvc repro` first")
    dictionary = Dictionary(folder, device)
    if not dictionary.systems:
        raise InputError(folder, "empty", "holds no trained model; run `dvc repro` first")
    return dictionary


class Dictionary(Editing):
    """A folder of trained systems that is asked; see :func:`load`. Several threads may share one: they take turns."""

    def caption(
        self,
        motions: Motion | Sequence[Motion],
        n: int = 1,
        beams: int = 2,
        system: str | None = None,
        seed: int = 0,
        temperature: float | None = None,
        consensus: int = 0,
        source: str | None = None,
    ) -> list[Any]:
        """Sentences that describe a motion, as people write them unless the captioner learned normalized words.

        Args:
            motions: one or several, on any rig and at any rate; of a longer one the first ten seconds are read.
            n: captions of each, best first.
            beams: of the beam search; at least n are kept.
            system: the motion-to-text system that answers; None takes the usual one.
            seed, temperature: with a temperature, captions are drawn and not searched.
            consensus: choose the captions that agree best with this many draws, which takes longer; 0 searches only.
            source: in the words of which source of training captions, where they had several: a name as `clips.jsonl`
                gave it. None takes the usual one.

        Returns:
            n captions; for several motions a list of n captions for each.

        Raises:
            InputError: a motion that is too short or on an unknown rig, a value out of range, a missing system.
        """
        several = listed(motions, Motion, "motions")
        for name, value in (("n", n), ("beams", beams)):
            check_whole(name, value, 1, MOST_ASKED)
        check_whole("seed", seed, 0)
        check_whole("consensus", consensus, 0, MOST_DRAWS)
        check_options({"temperature": temperature})
        if consensus and temperature is not None:
            raise InputError("consensus", consensus, "draws at temperature 1; leave `temperature` out")
        captioner: MotionToText = self._open(MOTION_TO_TEXT, system)
        context = captioner.context
        if source is not None and source not in captioner.sources:
            known = ", ".join(captioner.sources) or "none was told apart in training"
            raise InputError("source", source, f"must be a source of captions that the captioner knows: {known}")
        features = [encode(motion, context) for motion in several]
        drawn = {"seeds": [seed] * len(features), "temperature": temperature, "consensus": consensus, "source": source}
        with self._lock:
            found = captioner.caption(features, beams=max(beams, n), n=n, **drawn)
        return found[0] if isinstance(motions, Motion) else found

    def search(self, texts: str | Sequence[str], k: int = 5, system: str | None = None) -> list[Any]:
        """The windows of the corpus that lie nearest to a text, by the usual system that searches or by `system`.

        Returns:
            k of :class:`Match`, nearest first; for several texts a list of k for each.

        Raises:
            InputError: a text that cannot be read, k below 1, or a missing evaluator, index or corpus.
        """
        check_whole("k", k, 1, MOST_ASKED)
        sentences = self._sentences(texts)
        retrieval: CorpusSearch = self._open(SEARCH, system)
        with self._lock:
            queries, found = retrieval.judge.sentences(sentences), retrieval.search(sentences, k)
        rows = []
        for query, places in zip(queries, found, strict=True):
            away = np.linalg.norm(np.asarray(retrieval.index.motions[places]) - query, axis=-1)
            rows.append([Match.of(retrieval.corpus, int(i), float(d)) for i, d in zip(places, away, strict=True)])
        return rows[0] if isinstance(texts, str) else rows

    def embed(
        self,
        texts: str | Sequence[str] | None = None,
        motions: Motion | Sequence[Motion] | None = None,
        system: str | None = None,
    ) -> np.ndarray:
        """(N, D) float32 vectors of N texts or N motions in one space, where matching ones lie near: the evaluator's,
        or that of another `system`.

        Raises:
            InputError: not exactly one of the two is given, or one of them cannot be read.
        """
        if (texts is None) == (motions is None):
            raise InputError("texts, motions", "neither" if texts is None else "both", "give one of the two")
        if texts is not None:
            sentences = self._sentences(texts)
            judge = self._judge(system)
            with self._lock:
                return judge.sentences(sentences)
        several = listed(motions, Motion, "motions")
        judge = self._judge(system)
        features = [encode(motion, judge.context) for motion in several]
        with self._lock:
            return judge.motions(features)

    @property
    def styles(self) -> tuple[str, ...]:
        """The styles that :meth:`stylize` knows by name."""
        return self._open(STYLIZE).styles

    def stylize(
        self,
        motions: Motion | Sequence[Motion],
        style: str | None = None,
        reference: Motion | None = None,
        n: int = 1,
        seed: int = 0,
        strength: float = 1.0,
        keep_rig: bool = False,
        feet: bool = True,
    ) -> list[Any]:
        """A motion in another style: of a label, of a reference motion, of both, or of neither, drawn at random.

        Args:
            motions: one or several, of any length, on any rig that can be retargeted and at any rate.
            style: a name among :attr:`styles`.
            reference: a motion in the wanted style, of at least a second or two. With `style` it says in which way.
            n: variants; a reference has only one.
            seed: equal motion, style, seed and variant give an equal result, whatever else is asked with them.
            strength: 0 is the motion as the model rebuilds it, 1 the full style, more exaggerates.
            keep_rig: return each motion onto the rig and rate that it came from.
            feet: let them stand; False gives what the models made.

        Returns:
            n motions, as long as the given one, at the models' rate and on their skeleton unless `keep_rig`, starting
            at the origin; for several motions a list of n for each.

        Raises:
            InputError: an unknown style (the known ones are listed), a reference that is too short, an unknown rig,
                a value out of range, missing models.
        """
        from motionary.dictionary.restyling import returned, stylize

        several = listed(motions, Motion, "motions")
        transfer = self._open(STYLIZE)
        with self._lock:
            found = stylize(transfer, several, style, reference, n, seed, strength)
        found = [planted(row, feet) for row in found]
        if keep_rig:
            found = [[returned(made, motion) for made in row] for row, motion in zip(found, several, strict=True)]
        return found[0] if isinstance(motions, Motion) else found

    def interpolate(
        self,
        motion: Motion,
        first: str | Motion,
        second: str | Motion,
        steps: int = 5,
        seed: int = 0,
        feet: bool = True,
    ) -> list[Motion]:
        """A motion in `steps` styles from one to another: two names among :attr:`styles`, or two reference motions.

        Raises:
            InputError: as :meth:`stylize`; also where one end is a name and the other a motion.
        """
        from motionary.dictionary.restyling import interpolate

        content = one(motion, Motion, "motion")
        transfer = self._open(STYLIZE)
        with self._lock:
            return planted(interpolate(transfer, content, first, second, steps, seed), feet)

    @property
    def actions(self) -> tuple[str, ...]:
        """The actions that :meth:`act` knows by name."""
        return self._open(ACT).actions

    def act(
        self,
        action: str | Sequence[str],
        n: int = 1,
        seconds: float | Sequence[float] = 3.0,
        seed: int = 0,
        scale: float = 1.0,
        start: Motion | None = None,
        feet: bool = True,
    ) -> list[Motion]:
        """Motions of an action, or of several that follow each other in one motion.

        Args:
            action: a name among :attr:`actions`, or several.
            n: variants.
            seconds: how long; for several actions one number for all or one for each.
            seed: equal actions, seconds, seed and variant give an equal motion, whatever else is asked.
            scale: of the body.
            start: a motion that is gone on from: its frames stand before the others.
            feet: let them stand from there on; False gives what the model made.

        Raises:
            InputError: an unknown action (the known ones are listed), a value out of range, a start on an unknown rig.
        """
        from motionary.dictionary.acting import act

        actor = self._open(ACT)
        with self._lock:
            return act(actor, action, n, seconds, seed, scale, start, feet)

    def between_actions(
        self,
        action: str,
        steps: int = 5,
        seconds: float = 3.0,
        seeds: tuple[int, int] = (0, 1),
        scale: float = 1.0,
        feet: bool = True,
    ) -> list[Motion]:
        """`steps` motions of an action, from the first seed's to one that starts as the second's.

        Raises:
            InputError: as :meth:`act`.
        """
        from motionary.dictionary.acting import between

        actor = self._open(ACT)
        with self._lock:
            return planted(between(actor, action, steps, seconds, seeds, scale), feet)
