"""One clip at a time: read, resample, retarget, cut, canonicalize, encode. Runs in parallel processes."""

from __future__ import annotations

import multiprocessing
import os
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import islice

import numpy as np

from motionary.corpus.checks import unforeseen
from motionary.corpus.clips import Clip, checked_captions
from motionary.corpus.config import RELEASED
from motionary.corpus.windows import Rule, Window, windows
from motionary.errors import InputError
from motionary.features import codec
from motionary.motion import Motion, Skeleton, canonicalize, mirror, resample, retarget

CHUNK = 8  # clips per task: large enough to hide the cost of a task, small enough to keep results few in memory
JUMP = 0.04  # m that joints move on average, relative to the root, in the jump out of a bind pose
CALM = 0.3  # the step after that jump is a smaller part of it than this
FASTEST = 15.0  # m/s of the root; nobody has run faster, so this is a tracking error


@dataclass(frozen=True)
class Recipe:
    """What every clip becomes."""

    skeleton: str
    codec: str
    rule: Rule
    mirror: bool


@dataclass
class Encoded:
    """What became of one clip: its windows with their raw features, or why there are none."""

    clip: Clip
    seconds: float = 0.0
    windows: list[tuple[Window, np.ndarray, np.ndarray | None]] = field(default_factory=list)
    dropped: Counter = field(default_factory=Counter)
    problems: list[InputError] = field(default_factory=list)


def encode_clip(clip: Clip, split: str, recipe: Recipe) -> Encoded:
    """Everything that preprocess does to one clip; never raises on bad data, but reports it.

    Windows of training clips come with a mirrored copy where the recipe and the clip allow it.
    """
    result = Encoded(clip)
    try:
        motion, clip = clip.load(clip)
        result.seconds = motion.duration
        # The released loaders cut a caption that overhangs its motion; elsewhere it is a mistake.
        released = recipe.rule.cut == RELEASED
        result.clip, result.problems = (clip, []) if released else checked_captions(clip, motion.duration)
        motion = resample(without_bind_pose(motion), recipe.rule.fps)
        motion = retarget(motion, _skeleton(recipe.skeleton))
        found, result.dropped = windows(result.clip, motion.frames, recipe.rule)
        twin = recipe.mirror and clip.mirrors and split == "train"
        for window in found:
            part = motion.crop(window.first, window.first + window.length + 1)
            speed = _root_speed(part)
            if speed > FASTEST:
                rule = f"root must not move faster than {FASTEST:g} m/s; window {window.start:.2f} s dropped"
                result.problems.append(InputError(clip.where, f"{speed:.1f} m/s", rule))
                result.dropped["root jumps"] += 1
                continue
            part = canonicalize(part)
            features = _encode(part, recipe, clip)
            flipped = _encode(canonicalize(mirror(part)), recipe, clip) if twin else None
            result.windows.append((window, features, flipped))
    except InputError as problem:
        _fail(result, problem)
    # A reader or a generator that fails in a way nobody foresaw must not end a run of hours.
    except Exception as error:
        _fail(result, unforeseen(clip.where, error))
    return result


def clip_labels(clip: Clip, *_) -> Clip:
    """The clip with the labels that only its loader knows (the demo's); unchanged where it cannot be read."""
    try:
        return clip.load(clip)[1]
    except Exception:  # the same comes back, and is reported, when the clip is encoded
        return clip


def without_bind_pose(motion: Motion) -> Motion:
    """The motion with a leading bind pose replaced by the first real frame, so that times stay.

    Some exporters put the bind pose in frame 0, some blend out of it over a few frames, at most 0.1 s. A quick start of
    the motion itself is told apart: in a bind pose the body stands with its arms out, and after the jump it is calm.
    """
    if motion.frames < 3 or not _arms_out(motion):
        return motion
    latest = max(1, round(0.1 * min(motion.fps, 1e3)))
    pose = motion.positions[: latest + 2] - motion.positions[: latest + 2, :1]
    steps = np.linalg.norm(np.diff(pose, axis=0), axis=-1).mean(axis=1)
    away = np.linalg.norm(pose[1:] - pose[0], axis=-1).mean(axis=1)  # of frame 1, 2, ... from the first
    calm = [k for k in range(1, len(steps)) if away[k - 1] > JUMP and steps[k] < away[k - 1] * CALM / k]
    if not calm:
        return motion
    first = calm[0]

    def held(values: np.ndarray) -> np.ndarray:
        """The values with the frames before the first calm one replaced by it."""
        return np.concatenate([np.repeat(values[first : first + 1], first, axis=0), values[first:]])

    rotations = None if motion.rotations is None else held(motion.rotations)
    return replace(motion, positions=held(motion.positions), rotations=rotations)


def _arms_out(motion: Motion) -> bool:
    """Whether the first frame stands upright with both arms within 60 degrees of the line through the shoulders."""
    roles = motion.skeleton.roles
    names = [f"{side}_{part}" for side in ("left", "right") for part in ("hip", "ankle", "shoulder", "elbow", "wrist")]
    if not set(names) <= roles.keys():
        return False
    at = {name: motion.positions[0, roles[name]].astype(np.float64) for name in names}
    across = at["left_shoulder"] - at["right_shoulder"]

    def cosine(begin: str, end: str, line: np.ndarray) -> float:
        """Cosine of the angle between the bone from `begin` to `end` and the direction `line`."""
        bone = at[end] - at[begin]
        return float(bone @ line / max(np.linalg.norm(bone) * np.linalg.norm(line), 1e-9))

    for side, out in (("left", across), ("right", -across)):
        if min(cosine(f"{side}_{a}", f"{side}_{b}", out) for a, b in (("shoulder", "elbow"), ("elbow", "wrist"))) < 0.5:
            return False
        if cosine(f"{side}_ankle", f"{side}_hip", np.array([0.0, 1.0, 0.0])) < 0.85:
            return False
    return True


def in_order(task: Callable, jobs: Sequence[tuple], workers: int, chunk: int = CHUNK) -> Iterator:
    """task(*job) for every job, results in the order of the jobs.

    One process runs in this one; several are spawned with one thread each, given `chunk` jobs at a time, and at most a
    few chunks are in flight, so memory does not grow with the number of jobs.
    """
    if workers == 1 or len(jobs) <= chunk:
        yield from (task(*job) for job in jobs)
        return
    chunks = (jobs[i : i + chunk] for i in range(0, len(jobs), chunk))
    with (
        _one_thread(),
        ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool,
    ):
        waiting = deque(pool.submit(_run, task, some) for some in islice(chunks, 2 * workers))
        try:
            while waiting:
                results = waiting.popleft().result()
                waiting.extend(pool.submit(_run, task, some) for some in islice(chunks, 1))
                yield from results
        finally:
            for future in waiting:
                future.cancel()


def _run(task: Callable, jobs: Sequence[tuple]) -> list:
    return [task(*job) for job in jobs]


@contextmanager
def _one_thread():
    """Child processes read these when they load numpy; two threads in each of two processes would fight."""
    names = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@lru_cache
def _skeleton(name: str) -> Skeleton:
    return Skeleton.named(name)


@lru_cache
def _codec(name: str, skeleton: str):
    return codec(name, _skeleton(skeleton))


def _encode(motion: Motion, recipe: Recipe, clip: Clip) -> np.ndarray:
    features = _codec(recipe.codec, recipe.skeleton).encode(motion)
    if not np.isfinite(features).all():
        raise InputError(clip.where, "not finite", "features must be finite; the motion is degenerate")
    return features


def _root_speed(motion: Motion) -> float:
    return float(np.linalg.norm(np.diff(motion.positions[:, 0], axis=0), axis=-1).max() * motion.fps)


def _fail(result: Encoded, problem: InputError) -> None:
    """A clip that fails half-way gives nothing."""
    if not any(name and name in problem.what for name in (result.clip.where, getattr(result.clip.load, "path", ""))):
        problem = InputError(f"{result.clip.where}: {problem.what}", problem.value, problem.rule)
    result.windows, result.dropped = [], Counter({"unusable clip": 1})
    result.problems.append(problem)
