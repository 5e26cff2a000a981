"""Parts of motions made anew: `edit`, `between` and `extend` of a trained pipeline."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from motionary.corpus.context import Context
from motionary.corpus.encoding import encode
from motionary.dictionary.control import edited, on_models
from motionary.dictionary.generating import Generating
from motionary.dictionary.infilling import infilled
from motionary.errors import InputError, check_whole, is_real, shortened
from motionary.motion import Motion
from motionary.motion.paths import FASTEST
from motionary.systems.control_protocols import MotionInfiller
from motionary.systems.protocols import MotionToText
from motionary.systems.registry import INFILL, MOTION_TO_TEXT, TEXT_TO_MOTION


class Editing(Generating):
    """What a folder's systems make of a part of a motion. Results are on the models' skeleton, at their rate."""

    def edit(
        self, motion: Motion, text: str, start: float, end: float, seed: int = 0, system: str | None = None,
        feet: bool = True,
    ) -> Motion:  # fmt: skip
        """The motion in which the seconds from start to end are made anew; the rest stays as it is.

        Args:
            motion: on any rig that can be retargeted, at any rate.
            text: an English text for the span.
            start, end: seconds, 0 <= start < end <= its length; at most as long as systems learn.
            seed, system, feet: as of `generate`; feet outside of the span stay as they are. A system that sees what
                stands around the span comes first, where there is one.

        Raises:
            InputError: an empty span or one out of range, a text that cannot be read, an unknown rig.
        """
        context = self._maker(system)
        body = on_models(motion, context, "motion")
        first, last = _span(start, end, body, context)
        if first == 0 and last == body.frames:
            raise InputError("start, end", f"{start:g} to {end:g} s", "is the whole motion; generate it instead")
        piece = self._piece(body, (first, last), text, seed, system, feet)
        return edited(body, (first, last), piece, feet)

    def between(
        self, first: Motion, last: Motion, seconds: float = 1.0, text: str | None = None, seed: int = 0,
        system: str | None = None, feet: bool = True,
    ) -> Motion:  # fmt: skip
        """A motion of so many seconds from one motion's last frame to another's first, both included.

        Args:
            first, last: poses or motions, where they are; motions also say how fast it begins and ends.
            seconds: from the one pose to the other.
            text: what happens between them; None leaves it to a system that sees both, else, and where seconds are all
                that systems learn, takes the shortest way.
            seed, system, feet: as of `generate`.

        Raises:
            InputError: poses farther apart than a person runs in that time, an unknown rig, a value out of range.
        """
        able = text is not None or self.offering(TEXT_TO_MOTION) or self.offering(INFILL)
        context = self._maker(system) if able else self.context(self.systems[0])
        head, tail = on_models(first, context, "first"), on_models(last, context, "last")
        frames = _frames(seconds, context, least=2) - 1
        away = float(((tail.positions[0, 0] - head.positions[-1, 0])[[0, 2]] ** 2).sum() ** 0.5)
        if away > FASTEST * seconds:
            rule = f"poses are {away:.1f} m apart; a person runs {FASTEST:g} m/s"
            raise InputError("seconds", f"{seconds:g}", rule)
        whole, span = _with_gap(head, tail, frames), (head.frames, head.frames + frames)
        piece = self._seen(whole, span, text, seed, system)
        if piece is None and text is not None:
            piece = self._told(whole, span, text, seed, system, feet)
        made = edited(whole, span, piece, feet)
        return made.crop(head.frames - 1, head.frames + frames + 1)

    def extend(
        self, motion: Motion, seconds: float = 2.0, text: str | None = None, seed: int = 0, system: str | None = None,
        feet: bool = True,
    ) -> Motion:  # fmt: skip
        """The motion and, after its last frame, so many seconds more.

        Args:
            motion: on any rig that can be retargeted, at any rate.
            seconds: of what is added.
            text: what happens then; None leaves it to a system that sees the motion, else, and where seconds are all
                that systems learn, goes on as its caption says.
            seed, system, feet: as of `generate`.

        Raises:
            InputError: a value out of range, an unknown rig, no text where nothing writes captions.
        """
        context = self._maker(system)
        body = on_models(motion, context, "motion")
        frames = _frames(seconds, context)
        whole = Motion(_held(body, frames), body.fps, body.skeleton)
        piece = self._piece(whole, (body.frames, whole.frames), text, seed, system, feet)
        return edited(whole, (body.frames, whole.frames), piece, feet)

    def _piece(
        self, whole: Motion, span: tuple[int, int], text: str | None, seed: int, system: str | None, feet: bool
    ) -> Motion:
        """What comes into a span of a motion: by a system that sees what is around it, else by a text alone, which is
        the caption of what comes before where none is given."""
        if (seen := self._seen(whole, span, text, seed, system)) is not None:
            return seen
        said = self._caption(whole.crop(0, span[0])) if text is None else text
        return self._told(whole, span, said, seed, system, feet)

    def _seen(
        self, whole: Motion, span: tuple[int, int], text: str | None, seed: int, system: str | None
    ) -> Motion | None:
        """By a system that sees what is around the span; None where there is none, or nothing that it could see."""
        if (infiller := self._infiller(system)) is None:
            return None
        check_whole("seed", seed, 0)
        sentence = None if text is None else self._sentences(text)[0]
        with self._lock:
            return infilled(infiller, whole, span, sentence, seed)

    def _told(
        self, whole: Motion, span: tuple[int, int], text: str, seed: int, system: str | None, feet: bool
    ) -> Motion:
        """By a text alone."""
        context, frames = self._maker(system), span[1] - span[0]
        unit = context.unit
        seconds = min(max(math.ceil(frames / unit), 1) * unit, context.max_frames) / context.fps
        (made,) = self.generate(text, 1, seconds, system, seed, feet)
        return made.crop(0, min(frames, made.frames))

    def _infiller(self, system: str | None) -> MotionInfiller | None:
        """The system that is asked, or the usual one, where it sees what is around a span."""
        names = self.offering(INFILL)
        name = system if system in names else None if system is not None else next(iter(names), None)
        return None if name is None else self._open(INFILL, name)

    def _caption(self, motion: Motion) -> str:
        """What a motion shows, by the usual captioner."""
        if not self.offering(MOTION_TO_TEXT):
            raise InputError("text", "none", "must be given: none of these models writes captions")
        captioner: MotionToText = self._open(MOTION_TO_TEXT)
        with self._lock:
            return captioner.caption([encode(motion, captioner.context)])[0][0]

    def _maker(self, system: str | None) -> Context:
        infiller = self._infiller(system)
        return self._open(TEXT_TO_MOTION, system).context if infiller is None else infiller.context


def _frames(seconds: Any, context: Context, least: int = 1) -> int:
    """Frames of a number of seconds; InputError names the range."""
    longest = context.max_frames / context.fps
    if not is_real(seconds) or not least / context.fps - 1e-9 <= seconds <= longest + 1e-9:
        raise InputError("seconds", seconds, f"must be a number from {least / context.fps:g} to {longest:g}")
    return round(seconds * context.fps)


def _span(start: Any, end: Any, motion: Motion, context: Context) -> tuple[int, int]:
    """First and last frame of a span in seconds."""
    numbers = is_real(start) and is_real(end)
    longest = context.max_frames / context.fps
    if not numbers or not 0 <= start < end <= motion.duration + 1e-6:
        rule = f"must be 0 <= start < end <= {motion.duration:g} s"
        raise InputError("start, end", f"{shortened(start)} to {shortened(end)}", rule)
    first, last = round(start * motion.fps), min(round(end * motion.fps), motion.frames)
    if last <= first:
        raise InputError("start, end", f"{start:g} to {end:g} s", f"holds no frame at {motion.fps:g} per second")
    if last - first > context.max_frames:
        raise InputError("start, end", f"{end - start:g} s", f"at most {longest:g} s can be made at once")
    return first, last


def _with_gap(head: Motion, tail: Motion, frames: int) -> Motion:
    gap = np.repeat(head.positions[-1:], frames, axis=0)
    return Motion(np.concatenate([head.positions, gap, tail.positions]), head.fps, head.skeleton)


def _held(motion: Motion, frames: int) -> np.ndarray:
    return np.concatenate([motion.positions, np.repeat(motion.positions[-1:], frames, axis=0)])
