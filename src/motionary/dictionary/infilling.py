"""A part of a motion made anew by a system that sees what stands around it."""

from __future__ import annotations

import numpy as np

from motionary.corpus.encoding import as_motion, encode
from motionary.language import Sentence
from motionary.motion import Motion
from motionary.systems.control_protocols import MotionInfiller


def infilled(
    infiller: MotionInfiller, motion: Motion, span: tuple[int, int], sentence: Sentence | None, seed: int
) -> Motion:
    """The frames of a span, made anew in view of as much before and after them as the system takes.

    Args:
        infiller: the system's.
        motion: on its skeleton at its rate; what stands in the span is not looked at.
        span: first frame and the one after the last, at most as many as systems learn.
        sentence: what happens there; None leaves it to the system.
        seed: of the draws.
    """
    context, (start, end) = infiller.context, span
    room, unit = context.max_frames - (end - start), context.unit
    lead = min(start, room if end == motion.frames else room // 2) // unit * unit
    shown = motion.positions[start - lead : start - lead + context.max_frames]
    missing = -len(shown) % unit
    shown = np.concatenate([shown, np.repeat(shown[-1:], missing, axis=0)])
    (tokens,) = infiller.encode([encode(Motion(shown, motion.fps, motion.skeleton), context)])
    first = np.arange(len(tokens)) * unit
    known = (first + unit <= lead) | (first >= lead + end - start)
    (made,) = infiller.decode(infiller.infill([tokens], [known], [sentence], [seed]))
    return as_motion(made, context).crop(lead, lead + end - start)
