"""A clip cut into windows that models can read, each with its seconds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from motionary.corpus.context import Context
from motionary.corpus.workers import without_bind_pose
from motionary.errors import InputError
from motionary.motion import Motion, canonicalize, repeat_last_step, resample, retarget

SECONDS = 5.0  # of a window; clips of up to half as long again are one
INSTANTS = 16  # of a window that its outline keeps


@dataclass(frozen=True)
class Cut:
    """A window of a clip: its seconds, raw features (T, D) of the corpus's codec, and its outline.

    Attributes:
        outline: (16, J, 3) float16 joints at even instants, facing ahead from the origin: near-duplicates lie near.
    """

    start: float
    end: float
    features: np.ndarray
    outline: np.ndarray


def cuts(motion: Motion, context: Context) -> list[Cut]:
    """The windows of a motion, which overlap by half where there are several.

    Raises:
        InputError: on an unknown rig, shorter than one unit, or degenerate.
    """
    motion = retarget(resample(without_bind_pose(motion), context.fps), context.skeleton)
    if motion.frames % context.unit == 0:
        motion = repeat_last_step(motion)  # features of T frames take T + 1
    codec, fps = context.make_codec(), context.fps
    found = []
    for first, length in windows_of(motion.frames - 1, context):
        part = canonicalize(motion.crop(first, first + length + 1))
        features = codec.encode(part)
        if not np.isfinite(features).all():
            raise InputError("motion", "not finite", "features must be finite; the motion is degenerate")
        at = np.linspace(0, length, INSTANTS).round().astype(int)
        found.append(Cut(first / fps, (first + length) / fps, features, part.positions[at].astype(np.float16)))
    return found


def windows_of(frames: int, context: Context) -> list[tuple[int, int]]:
    """First frame and length of each window of a clip of so many feature frames, in whole units.

    A clip of up to one and a half windows is one, as far as models read; a longer one is cut into windows that begin
    at most half a window apart and end where the clip ends.
    """
    unit, longest = context.unit, min(round(SECONDS * context.fps), context.max_frames)
    longest = longest // unit * unit
    if frames < unit:
        least = (unit + 1) / context.fps
        raise InputError("motion", f"{(frames + 1) / context.fps:.3f} s", f"must last at least {least:g} s")
    if frames <= min(1.5 * longest, context.max_frames):
        return [(0, frames // unit * unit)]
    count = 1 + int(np.ceil((frames - longest) / (longest / 2)))
    starts = np.linspace(0, frames - longest, count).round().astype(int)
    return [(int(start), longest) for start in starts]
