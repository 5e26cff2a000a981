"""Motions that follow each other, fill a gap or repeat, without a seam."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from motionary.errors import InputError
from motionary.motion.facing import heading, wrap
from motionary.motion.motion import Motion
from motionary.motion.pinning import bent, extrapolated, on_body, pinned, placed_at, posed, turns
from motionary.motion.planting import replant_feet
from motionary.motion.rotations import unitquat_slerp

_SEEN = 2  # frames of a neighbour that say where it is and how fast
_CONTEXT = 1.0  # seconds of the neighbours that say which feet stand
_ON_THE_SPOT = 0.5  # metres: a loop that goes less far comes back to where it began


def fitted(piece: Motion, before: Motion | None = None, after: Motion | None = None) -> Motion:
    """A piece that goes on from what is before it and leads into what is after it.

    The piece is moved as a whole to where `before` ends. If it then does not lead to `after`, its path over the ground
    is bent. Within a quarter of a second its pose and speed blend into those of its neighbours.

    Args:
        piece: with rotations, as all three must be.
        before, after: on the same skeleton, at the same rate; they are only read.
    """
    if before is not None:
        end = extrapolated(before, 0, 1)
        piece = placed_at(piece, 0, end.positions[-1, 0], float(heading(end)[-1]))
    elif after is not None:
        begin = extrapolated(after, 1, 0)
        piece = placed_at(piece, -1, begin.positions[0, 0], float(heading(begin)[0]))
    if before is not None and after is not None:
        piece = _led_to(piece, extrapolated(after, 1, 0).crop(0, 1))
    count = [0 if other is None else min(_SEEN, other.frames) for other in (before, after)]
    whole = extrapolated(piece, *count)
    frames = [*range(count[0]), *range(whole.frames - count[1], whole.frames)]
    seen = ([] if before is None else [before.crop(before.frames - count[0], before.frames)]) + (
        [] if after is None else [after.crop(0, count[1])]
    )
    if not seen:
        return piece
    whole = pinned(whole, frames, concatenated(seen))
    return whole.crop(count[0], count[0] + piece.frames)


def concatenated(motions: Sequence[Motion]) -> Motion:
    """One motion after the other, as they are, all with rotations on one skeleton."""
    roots = np.concatenate([motion.positions[:, 0] for motion in motions])
    return posed(motions[0].skeleton, np.concatenate([turns(m) for m in motions]), roots, motions[0].fps)


def joined(motions: Sequence[Motion], feet: bool = True) -> Motion:
    """One motion of several that follow each other, each going on from where the one before ends.

    Args:
        motions: of one rate and rig; the skeleton is the first's.
        feet: let them stand over the seams too.
    """
    parts = [on_body(motions[0])]
    for motion in motions[1:]:
        before = parts[-1].crop(max(0, parts[-1].frames - _SEEN), parts[-1].frames)
        parts.append(fitted(on_body(motion, parts[0].skeleton), before))
    whole = concatenated(parts)
    return replant_feet(whole, np.zeros(whole.frames, bool)) if feet else whole


def filled(piece: Motion, before: Motion | None, after: Motion | None, feet: bool = True) -> Motion:
    """`fitted`, with feet that stand on where they stand before and after."""
    piece = fitted(piece, before, after)
    if not feet:
        return piece
    frames = round(_CONTEXT * piece.fps)
    head = [] if before is None else [before.crop(max(0, before.frames - frames), before.frames)]
    tail = [] if after is None else [after.crop(0, min(frames, after.frames))]
    whole = concatenated([*head, piece, *tail])
    start = sum(part.frames for part in head)
    kept = np.ones(whole.frames, bool)
    kept[start : start + piece.frames] = False
    return replant_feet(whole, kept).crop(start, start + piece.frames)


def looped(motion: Motion, feet: bool = True) -> Motion:
    """The motion, whose last frame is its first again, at the same speed and heading, so that it can be repeated.

    Where it goes less than half a metre it comes back to where it began; otherwise each round goes on from the last.
    """
    if motion.frames < 2 * _SEEN + 2:
        raise InputError("loop", f"{motion.frames} frames", f"must have at least {2 * _SEEN + 2}")
    motion = on_body(motion)
    travel = (motion.positions[-1, 0] - motion.positions[0, 0]) * np.array([1, 0, 1])
    straight = bent(motion, -float(wrap(np.diff(heading(motion)[[0, -1]]))[0]) * _ramp(motion.frames), np.zeros(3))
    gone = (straight.positions[-1, 0] - straight.positions[0, 0]) * np.array([1, 0, 1])
    if np.linalg.norm(travel) < _ON_THE_SPOT:
        straight = bent(straight, np.zeros(motion.frames), -gone * _ramp(motion.frames)[:, None])
        gone = np.zeros(3)
    again = extrapolated(straight.crop(0, 2), 1, 0)  # the frames before, at and after the seam, at one speed
    again = bent(again, np.zeros(3), np.tile(gone, (3, 1)))
    whole = extrapolated(straight, 0, 1)
    last = whole.frames - 1
    firm = concatenated([straight.crop(0, 2), again])
    closed = pinned(whole, [0, 1, last - 2, last - 1, last], firm).crop(0, motion.frames)
    if not feet:
        return closed
    kept = np.zeros(motion.frames, bool)
    kept[[0, 1, -2, -1]] = True
    return replant_feet(closed, kept)


def interpolated(first: Motion, last: Motion, frames: int) -> Motion:
    """`frames` frames between the last frame of one motion and the first of another, along the shortest way."""
    share = np.arange(1, frames + 1) / (frames + 1)
    begin, end = turns(first)[-1:], turns(last)[:1]
    rotations = unitquat_slerp(np.repeat(begin, frames, 0), np.repeat(end, frames, 0), share)
    a, b = first.positions[-1, 0], last.positions[0, 0]
    return posed(first.skeleton, rotations, a + share[:, None] * (b - a), first.fps)


def stretched(motion: Motion, frames: int) -> Motion:
    """The motion, with rotations, in another number of frames at its rate: slower or faster."""
    time = np.linspace(0, motion.frames - 1, frames)
    before = np.minimum(time.astype(int), max(motion.frames - 2, 0))
    after = np.minimum(before + 1, motion.frames - 1)
    share, rotations = time - before, turns(motion)
    roots = motion.positions[:, 0]
    roots = roots[before] + share[:, None] * (roots[after] - roots[before])
    return posed(motion.skeleton, unitquat_slerp(rotations[before], rotations[after], share), roots, motion.fps)


def _led_to(piece: Motion, goal: Motion) -> Motion:
    """The piece, whose way bends for its last frame to be over the goal's and to face as it."""
    ramp = _ramp(piece.frames)
    yaw = float(wrap(heading(goal) - heading(piece)[-1:])[0])
    piece = bent(piece, yaw * ramp, np.zeros(3))
    off = (goal.positions[0, 0] - piece.positions[-1, 0]) * np.array([1, 0, 1])
    return bent(piece, np.zeros(piece.frames), off * ramp[:, None])


def _ramp(frames: int) -> np.ndarray:
    """(T,) from 0 to 1, at rest at both ends."""
    share = np.linspace(0, 1, frames) if frames > 1 else np.ones(1)
    return share**2 * (3 - 2 * share)
