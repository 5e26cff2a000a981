"""Motion that is told where to go, through which poses, or what to become: with any system that makes motion of text.

Systems are asked for motions as they always are; joining, bending and planting (`motionary.motion.joining`, `pinning`,
`paths`) then meet what was asked, along the smoothest correction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from motionary.corpus.context import Context
from motionary.corpus.encoding import one
from motionary.errors import InputError
from motionary.motion import Motion, resample, retarget
from motionary.motion.joining import concatenated, filled, interpolated, joined, looped, stretched
from motionary.motion.paths import FASTEST, along, checked_path, length_of
from motionary.motion.pinning import on_body, pinned, touching
from motionary.motion.planting import replant_feet

MOST_PROMPTS = 20  # of one motion
_SLOWEST = 0.2  # m/s: what goes slower by itself does not say how long a path takes
Make = Callable[[float], Motion]  # a motion of so many seconds


def join(motions: Sequence[Motion], feet: bool) -> Motion:
    """One motion of several that follow each other; feet stand within each already."""
    whole = joined(motions, feet)
    return bare(whole, motions[0])


def constrained(
    motion: Motion, loop: bool, path: Any, keyframes: Mapping[float, Motion] | None, feet: bool, context: Context
) -> Motion:
    """The motion led along a path, through keyframes, or closed to a loop; as it is without any."""
    if loop:
        return bare(looped(motion, feet), motion)
    if path is not None:
        return bare(along(motion, checked_path(path, motion.duration), feet), motion)
    if not keyframes:
        return motion
    given = checked_keyframes(keyframes, motion.frames, context)
    body, frames = on_body(motion), sorted(given)
    poses = concatenated([on_body(given[frame], body.skeleton) for frame in frames])
    kept = np.isin(np.arange(motion.frames), frames)
    led = pinned(body, frames, poses)
    led = replant_feet(led, kept) if feet else led
    return bare(touching(led, frames, np.concatenate([given[frame].positions for frame in frames])), motion)


def check_one(loop: bool, path: Any, keyframes: Any, join: bool, texts: int) -> None:
    """InputError where constraints contradict each other."""
    for name, value in (("loop", loop), ("join", join)):
        if not isinstance(value, bool):
            raise InputError(name, value, "must be True or False")
    if keyframes is not None and not isinstance(keyframes, Mapping):
        raise InputError("keyframes", type(keyframes).__name__, "must be {seconds: pose}")
    if len(asked := [n for n, v in (("loop", loop), ("path", path is not None), ("keyframes", keyframes)) if v]) > 1:
        raise InputError(", ".join(asked), "together", "contradict each other; give one of them")
    if join and texts > MOST_PROMPTS:
        raise InputError("texts", f"{texts} prompts", f"at most {MOST_PROMPTS} can become one motion")


def checked_keyframes(keyframes: Mapping[Any, Any], frames: int, context: Context) -> dict[int, Motion]:
    """Keyframes by frame, each one frame on the models' skeleton.

    Raises:
        InputError: no poses at times within the motion, two at one frame, or farther apart than a person runs.
    """
    found: dict[int, Motion] = {}
    longest = (frames - 1) / context.fps
    for seconds, pose in keyframes.items():
        if isinstance(seconds, bool) or not isinstance(seconds, int | float) or not 0 <= seconds <= longest + 1e-6:
            raise InputError("keyframes", seconds, f"times must be from 0 to {longest:g} s, within the motion")
        given = one(pose, Motion, f"keyframes at {seconds:g} s")
        frame = min(round(seconds * context.fps), frames - 1)
        if frame in found:
            raise InputError("keyframes", f"{seconds:g} s", "two poses fall on one frame")
        found[frame] = retarget(replace(given, fps=context.fps).crop(0, 1), context.skeleton)
    _check_reach(found, context.fps)
    return found


def _check_reach(poses: Mapping[int, Motion], fps: float) -> None:
    """InputError for poses farther apart than a person runs."""
    frames = sorted(poses)
    for a, b in pairwise(frames):
        apart = float(np.linalg.norm((poses[b].positions - poses[a].positions)[0, 0, [0, 2]]))
        if apart > FASTEST * (b - a) / fps + 0.05:
            rule = f"{apart:.1f} m apart in {(b - a) / fps:.2f} s; a person runs {FASTEST:g} m/s"
            raise InputError("keyframes", f"{a / fps:g} and {b / fps:g} s", rule)


def paced(line: np.ndarray, make: Make, shortest: float, longest: float) -> Motion:
    """A motion of as many seconds as its own speed takes to go a line (N, 2), within what systems make."""
    first = make(longest)
    speed = length_of(first.positions[:, 0][:, [0, 2]].astype(np.float64)) / first.duration
    wanted = length_of(line) / max(speed, length_of(line) / longest if speed < _SLOWEST else speed)
    wanted = min(max(wanted, length_of(line) / FASTEST, shortest), longest)
    return first if wanted == longest else make(wanted)


def edited(motion: Motion, span: tuple[int, int], piece: Motion | None, feet: bool) -> Motion:
    """The motion whose frames of a span are made anew; the others stay as they are, to the bit.

    Args:
        motion: on the models' skeleton at their rate.
        span: first frame and the one after the last, within the motion or up to its end and beyond.
        piece: what comes there, in any place and of any length; None: the shortest way between its neighbors.
        feet: let them stand.
    """
    start, end = span
    body = on_body(motion)
    before = body.crop(0, start) if start > 0 else None
    after = body.crop(end, motion.frames) if end < motion.frames else None
    if piece is None:
        assert before is not None
        assert after is not None
        piece = interpolated(before, after, end - start)
    else:
        piece = stretched(on_body(piece, body.skeleton), end - start)
    made = filled(piece, before, after, feet)
    parts = [motion.positions[:start], made.positions, motion.positions[end:]]
    return Motion(np.concatenate(parts), motion.fps, motion.skeleton)


def on_models(motion: Any, context: Context, name: str) -> Motion:
    """Any motion on the models' skeleton at their rate, where it is, without rotations.

    Raises:
        InputError: no motion, or on an unknown rig.
    """
    given = one(motion, Motion, name)
    return retarget(resample(given, context.fps), context.skeleton)


def bare(motion: Motion, like: Motion) -> Motion:
    """The motion without rotations and on the skeleton of `like`, where `like` has no rotations; else as it is."""
    return motion if like.rotations is not None else replace(like, positions=motion.positions)
