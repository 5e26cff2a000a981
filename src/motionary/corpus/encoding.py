"""What users hand in: checked, and brought to the form that models read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from motionary.corpus.context import Context
from motionary.corpus.workers import without_bind_pose
from motionary.errors import InputError
from motionary.motion import Motion, canonicalize, repeat_last_step, resample, retarget
from motionary.motion.planting import plant_feet

T = TypeVar("T")
_MINUTE = 60.0
_NEAR_FLOOR = 0.1  # metres: what never comes lower climbs, or hangs


def encode(motion: Motion, context: Context, whole: bool = False) -> np.ndarray:
    """Raw features (T, D) of any motion, as preprocess would make them; T is a multiple of the unit, and at most
    the longest that models learn, or, where the motion shall come `whole`, all of its frames at the models' rate.

    Raises:
        InputError: shorter than one unit, on an unknown rig, or not finite once encoded.
    """
    if not whole:  # what lies far beyond what models read costs neither time nor memory
        motion = motion.crop(
            0, min(motion.frames, math.ceil((_MINUTE + context.max_frames / context.fps) * motion.fps))
        )
    motion = retarget(resample(without_bind_pose(motion), context.fps), context.skeleton)
    if whole or motion.frames % context.unit == 0:
        motion = repeat_last_step(motion)  # so that a generated motion is read whole
    frames, shortest = motion.frames - 1, 1
    if not whole:
        frames, shortest = min(frames, context.max_frames) // context.unit * context.unit, context.unit
    if frames < shortest:
        least = max(shortest, 2) / context.fps
        raise InputError("motion", f"{motion.duration:.3f} s", f"must last at least {least:g} s")
    features = context.make_codec().encode(canonicalize(motion.crop(0, frames + 1)))
    if not np.isfinite(features).all():
        raise InputError("motion", "not finite", "features must be finite; the motion is degenerate")
    return features


def as_motion(made: np.ndarray | Motion, context: Context) -> Motion:
    """What a generator handed out, as a Motion: features (T, D) of the corpus are decoded by its codec.

    This and :func:`as_features` are the border of every system. Inside, a system may use any features: where they
    are the corpus's, they cross as they are; where it has its own, it hands out a Motion and takes in
    ``context.make_codec().decode(...)``.
    """
    return made if isinstance(made, Motion) else context.make_codec().decode(made, fps=context.fps)


def planted(motions: Sequence[Motion], feet: bool = True, first_frame: int = 0) -> list[Motion]:
    """The motions with feet that stand, from a frame on; as they are where that is not wanted.

    Whole ones come onto the floor as well: the lowest joint of all frames at a height of 0, as in windows of a corpus.
    Models tell the mean of heights, by which bodies hang a few centimetres over it.
    """
    if not isinstance(feet, bool):
        raise InputError("feet", feet, "must be True or False")
    if not feet:
        return list(motions)
    stand = [plant_feet(motion, min(first_frame, motion.frames)) for motion in motions]
    return stand if first_frame else [_on_floor(motion) for motion in stand]


def _on_floor(motion: Motion) -> Motion:
    lowest = motion.positions[..., 1].min()
    if lowest > _NEAR_FLOOR:
        return motion
    return replace(motion, positions=motion.positions - lowest * np.array([0, 1, 0], np.float32))


def as_features(made: np.ndarray | Motion, context: Context) -> np.ndarray:
    """What a generator handed out, as features (T, D) of the corpus; see :func:`as_motion`."""
    return encode(made, context, whole=True) if isinstance(made, Motion) else made


def as_joints(motion: Motion, context: Context) -> np.ndarray:
    """Joints (T, J, 3) of any motion on the corpus's skeleton at its rate: on the floor, from the origin, facing +z."""
    return canonicalize(retarget(resample(without_bind_pose(motion), context.fps), context.skeleton)).positions


def frames_of(seconds: float, context: Context) -> int:
    """Frames of a length asked for, in whole units; InputError names the range."""
    unit, longest = context.unit / context.fps, math.ceil(context.max_frames / context.fps)
    if isinstance(seconds, bool) or not isinstance(seconds, int | float) or not unit <= seconds <= longest:
        raise InputError("seconds", seconds, f"must be a number from {unit:g} to {longest:g}")
    return min(round(seconds / unit) * context.unit, context.max_frames)


def listed(values: Any, kind: type[T], name: str) -> list[T]:
    """One value or several as a list; InputError for anything else."""
    if isinstance(values, kind):
        return [values]
    if isinstance(values, list | tuple) and values and all(isinstance(value, kind) for value in values):
        return list(values)
    raise InputError(name, repr(values), f"must be one {kind.__name__} or a list of them")


def one(value: Any, kind: type[T], name: str) -> T:
    """The value, or the one in a list of one; InputError for anything else."""
    found = value[0] if isinstance(value, list | tuple) and len(value) == 1 else value
    if not isinstance(found, kind):
        raise InputError(name, repr(value), f"must be one {kind.__name__}")
    return found
