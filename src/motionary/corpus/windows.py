"""From a clip in seconds to windows in frames: short segments dropped, long ones cut into equal pieces."""

from __future__ import annotations

import math
from dataclasses import dataclass

from motionary.corpus.clips import TOLERANCE, Caption, Clip


@dataclass(frozen=True)
class Window:
    """A stretch of a clip at the corpus rate.

    Attributes:
        first: first joint frame.
        length: feature frames, a multiple of the unit; `length + 1` joint frames are needed.
        start, end: seconds in the clip.
        captions: the captions that hold over the whole window.
    """

    first: int
    length: int
    start: float
    end: float
    captions: tuple[Caption, ...]


@dataclass(frozen=True)
class Rule:
    """How long a window may be (s), in steps of `unit` feature frames at `fps`."""

    fps: float
    min_seconds: float
    max_seconds: float
    unit: int

    @property
    def max_frames(self) -> int:
        """Most feature frames: one less than joint frames, down to a multiple of the unit (196 at 20 fps, 10 s)."""
        return (math.floor(self.max_seconds * self.fps + 1e-6) - 1) // self.unit * self.unit


def segments(clip: Clip, duration: float) -> list[tuple[float, float, tuple[Caption, ...]]]:
    """Distinct captioned segments (s) with their captions; the whole clip where it has none.

    Captions must lie inside the clip (`checked_captions`). Those whose starts and ends differ by at most 0.1 s share a
    segment: sources round the same cut to different rates.
    """
    if not clip.captions:
        return [(0.0, duration, ())]
    groups: list[tuple[float, float, list[Caption]]] = []
    for caption in clip.captions:
        start, end = caption.start or 0.0, duration if caption.end is None else caption.end
        for first, last, members in groups:
            if abs(first - start) <= TOLERANCE and abs(last - end) <= TOLERANCE:
                members.append(caption)
                break
        else:
            groups.append((start, end, [caption]))
    return [(start, end, tuple(members)) for start, end, members in groups]


def windows(clip: Clip, frames: int, rule: Rule) -> tuple[list[Window], int]:
    """Windows of a clip that has `frames` joint frames at the rule's rate, and how many segments were too short."""
    found, short = [], 0
    for start, end, captions in segments(clip, frames / rule.fps):
        # Half a frame of slack: a segment of 1.99 s at 20 fps is one of 2 s that somebody rounded.
        if end - start < rule.min_seconds - 0.5 / rule.fps:
            short += 1
            continue
        pieces = math.ceil((end - start) / rule.max_seconds - 1e-6)
        step = (end - start) / pieces
        for piece in range(pieces):
            begin, finish = start + piece * step, start + (piece + 1) * step
            first, last = round(begin * rule.fps), round(finish * rule.fps)
            # Frame `last` belongs to the next stretch, but the codec needs one joint frame more than it returns.
            length = min(min(last, frames - 1) - first, rule.max_frames) // rule.unit * rule.unit
            if length < rule.unit:
                short += 1
                continue
            found.append(Window(first, length, begin, min(begin + (length + 1) / rule.fps, finish), captions))
    return found, short
