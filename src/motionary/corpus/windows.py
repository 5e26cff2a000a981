"""From a clip in seconds to windows in frames: what its captions say, each in one window, and the rest without any."""

from __future__ import annotations

import math
import random
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from motionary.corpus.clips import TOLERANCE, Caption, Clip
from motionary.corpus.config import COVERING, RELEASED

SHORT, LONG = "segment too short", "segment too long for its captions"


@dataclass(frozen=True)
class Window:
    """A stretch of a clip at the corpus rate.

    Attributes:
        first: first joint frame.
        length: feature frames, a multiple of the unit; `length + 1` joint frames are needed.
        start, end: seconds in the clip.
        captions: what is said of it.
        cropped: its captions are of a longer stretch, of which it was drawn.
        rest: it has no caption, though others of its clip have.
    """

    first: int
    length: int
    start: float
    end: float
    captions: tuple[Caption, ...]
    cropped: bool = False
    rest: bool = False


@dataclass(frozen=True)
class Rule:
    """How long a window may be (s), in steps of `unit` feature frames at `fps`; the others as in `DataConfig`."""

    fps: float
    min_seconds: float
    max_seconds: float
    unit: int
    cut: str = COVERING
    least_cover: float = 0.0
    seed: int = 0

    @property
    def max_frames(self) -> int:
        """Most feature frames: one less than joint frames, down to a multiple of the unit (196 at 20 fps, 10 s)."""
        return (math.floor(self.max_seconds * self.fps + 1e-6) - 1) // self.unit * self.unit


def segments(clip: Clip, duration: float) -> list[tuple[float, float, tuple[Caption, ...]]]:
    """Distinct captioned segments (s) with their captions; a caption without times is of the whole clip.

    Captions must lie inside the clip (`checked_captions`). Those whose starts and ends differ by at most 0.1 s share a
    segment: sources round the same cut to different rates.
    """
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


def windows(clip: Clip, frames: int, rule: Rule) -> tuple[list[Window], Counter[str]]:
    """Windows of a clip that has `frames` joint frames at the rule's rate, and how many segments were left out, by
    reason.

    First each captioned segment once, as `rule.cut` says, then the rest of the clip without captions: what no such
    window shows, in equal pieces. The rest trains what reads no text.
    """
    cut = _released if rule.cut == RELEASED else _covering
    found, dropped = cut(clip, frames, rule)
    whole = not clip.captions
    for start, end in _gaps(found, frames / rule.fps):
        pieces = _pieces(start, end, frames, rule, rest=not whole)
        found += pieces
        dropped[SHORT] += whole and not pieces
    return found, +dropped


def _covering(clip: Clip, frames: int, rule: Rule) -> tuple[list[Window], Counter[str]]:
    """Every segment is one window; of one longer than a window a stretch is drawn once, from the seed and the clip's
    name, as HumanML3D was made. Where that would show less than `least_cover` of it, its captions are left out."""
    found, dropped = [], Counter[str]()
    for number, (start, end, captions) in enumerate(segments(clip, frames / rule.fps)):
        if _too_short(start, end, rule):
            dropped[SHORT] += 1
            continue
        spare = end - start - rule.max_seconds
        cropped = spare > TOLERANCE
        if cropped and rule.max_seconds < rule.least_cover * (end - start):
            dropped[LONG] += 1
            continue
        if cropped:
            start += random.Random(f"{rule.seed}:{clip.id}:{number}").uniform(0, spare)
            end = start + rule.max_seconds
        window = _window(start, end, frames, rule, captions, cropped=cropped)
        found += window
        dropped[SHORT] += not window
    return found, dropped


def _released(clip: Clip, frames: int, rule: Rule) -> tuple[list[Window], Counter[str]]:
    """The items that the released loaders make (T2M, TM2T): the captions of the whole motion are one, each caption with
    times is another; a motion, or a stretch of one, counts from min_seconds on and below max_seconds, in feature
    frames (HumanML3D 40 to 199, KIT-ML 24 to 199), of which whole units are used. Nothing is cropped."""
    features = frames - 1
    least, most = (round(seconds * rule.fps) for seconds in (rule.min_seconds, rule.max_seconds))
    timed = [caption for caption in clip.captions if caption.start is not None or caption.end is not None]
    items = [(0, features, tuple(caption for caption in clip.captions if caption not in timed))]
    for caption in timed:
        first = int((caption.start or 0.0) * rule.fps)
        last = features if caption.end is None else min(int(caption.end * rule.fps), features)
        items.append((first, last, (caption,)))
    found, dropped = [], Counter[str]()
    usable = least <= features < most
    for first, last, captions in items:
        count = last - first
        if captions and usable and least <= count < most:
            length = count // rule.unit * rule.unit
            end = (first + length + 1) / rule.fps
            found.append(Window(first, length, first / rule.fps, end, captions))
        elif captions:
            dropped[LONG if (features if not usable else count) >= most else SHORT] += 1
    return found, dropped


def _gaps(found: Sequence[Window], duration: float) -> list[tuple[float, float]]:
    """Stretches (s) of a clip that no window shows."""
    gaps, reached = [], 0.0
    for window in sorted(found, key=lambda window: window.start):
        if window.start > reached:
            gaps.append((reached, window.start))
        reached = max(reached, window.end)
    return [*gaps, (reached, duration)] if reached < duration else gaps


def _pieces(start: float, end: float, frames: int, rule: Rule, rest: bool) -> list[Window]:
    """Equal pieces of an uncaptioned stretch, none longer than a window may be; none where it is too short."""
    if _too_short(start, end, rule):
        return []
    count = math.ceil((end - start) / rule.max_seconds - 1e-6)
    step = (end - start) / count
    cuts = [(start + n * step, start + (n + 1) * step) for n in range(count)]
    return [window for begin, finish in cuts for window in _window(begin, finish, frames, rule, rest=rest)]


def _window(
    start: float, end: float, frames: int, rule: Rule, captions: tuple[Caption, ...] = (), **kind: bool
) -> list[Window]:
    """The window of a stretch (s) that fits into one, as a list; empty where less than a unit is left."""
    first, last = round(start * rule.fps), round(end * rule.fps)
    # Frame `last` belongs to the next stretch, but the codec needs one joint frame more than it returns.
    length = min(min(last, frames - 1) - first, rule.max_frames) // rule.unit * rule.unit
    if length < rule.unit:
        return []
    return [Window(first, length, start, min(start + (length + 1) / rule.fps, end), captions, **kind)]


def _too_short(start: float, end: float, rule: Rule) -> bool:
    # Half a frame of slack: a segment of 1.99 s at 20 fps is one of 2 s that somebody rounded.
    return end - start < rule.min_seconds - 0.5 / rule.fps
