"""A part of a motion made anew by a system that sees what stands around it."""

from __future__ import annotations

import numpy as np

from motionary.corpus.encoding import as_motion, encode
from motionary.language import Sentence
from motionary.motion import Motion
from motionary.systems.control_protocols import MotionInfiller


def infilled(
    infiller: MotionInfiller, motion: Motion, span: tuple[int, int], sentence: Sentence | None, seed: int
) -> Motion | None:
    """The frames of a span, made anew in view of as much before and after them as the system takes.

    What stands there for less than a token is held for one, so that a single pose is seen too.

    Args:
        infiller: the system's.
        motion: on its skeleton at its rate; what stands in the span is not looked at.
        span: first frame and the one after the last, at most as many as systems learn.
        sentence: what happens there; None leaves it to the system.
        seed: of the draws.

    Returns:
        The frames, or None where nothing says what they shall be: no sentence, and a span so long that the system sees
        nothing around it.
    """
    context, (start, end) = infiller.context, span
    unit, made = context.unit, end - start
    room, mixed = context.max_frames - made, -made % unit  # frames of the token that holds both span and motion
    before = max(start, unit) if start else 0
    after = max(motion.frames - end, mixed + unit) if end < motion.frames else 0
    lead = min(before, max(room // 2, room - after)) // unit * unit
    tail = min(after, room - lead)
    places = np.arange(start - lead, end + tail).clip(0, motion.frames - 1)
    shown = motion.positions[np.pad(places, (0, -len(places) % unit), mode="edge")]
    (tokens,) = infiller.encode([encode(Motion(shown, motion.fps, motion.skeleton), context)])
    first = np.arange(len(tokens)) * unit
    known = (first + unit <= lead) | (first >= lead + made)
    if sentence is None and not known.any():
        return None
    (filled,) = infiller.decode(infiller.infill([tokens], [known], [sentence], [seed]))
    return as_motion(filled, context).crop(lead, lead + made)
