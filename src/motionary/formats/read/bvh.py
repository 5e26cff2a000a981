"""BVH (Biovision hierarchy) in and out, with true local rotations."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.files import read_text
from motionary.formats.bvh_text import RawBVH, parse
from motionary.formats.read.reading_options import Reading, ReadingOptions
from motionary.formats.tracks import Track, to_motion
from motionary.motion import Motion
from motionary.motion.motion import FASTEST_RATE, SLOWEST_RATE
from motionary.motion.rotations import euler_to_unitquat

_LONGEST_FRAME = 1 / SLOWEST_RATE  # s; slower than that is no recording of motion, but a rate in another unit


def read_bvh(path: str | os.PathLike, fps: float | None = None, **options: Any) -> Motion:
    """The motion of `bvh_with`; options are those of `ReadingOptions`."""
    return bvh_with(path, ReadingOptions(**options), fps)[0]


def bvh_with(
    path: str | os.PathLike, options: ReadingOptions | None = None, fps: float | None = None
) -> tuple[Motion, Reading]:
    """Read a BVH file: any channel order, rotation and position channels on any joint, end sites; and how it was read.

    Every joint stays, helpers and fingers too; end sites that have a length become joints named ``<parent>_end``.
    Position channels replace a joint's OFFSET, unless they are zero through the whole file. Rotations are the file's
    own; where a joint other than the root also moves, positions are true and rotations alone do not reproduce them.

    Args:
        path: the file.
        options: what the user knows of the file.
        fps: overrides the file's frame time.

    Raises:
        InputError: unreadable, truncated, wrong counts, or numbers that are not finite: file, line and rule.
    """
    raw = parse(read_text(path), path)
    rate = _rate(raw.frame_time, path) if fps is None else fps
    motion, reading = to_motion(_track(raw), rate, path, options or ReadingOptions())
    return motion, replace(reading, notes=(*raw.notes, *reading.notes))


def _rate(frame_time: float, file: object) -> float:
    """Frames per second; a whole number where the file's rounded frame time means one (.0083333 is 120)."""
    if frame_time > _LONGEST_FRAME:
        rule = f"must be seconds per frame, at most {_LONGEST_FRAME:g}"
        if frame_time < 1100:
            rule += f" (milliseconds? then say fps={1000 / frame_time:.4g}, --fps)"
        raise InputError(f"{file}, Frame Time", f"{frame_time:g}", rule)
    if frame_time < 1 / FASTEST_RATE:
        rule = f"must be seconds per frame, at least {1 / FASTEST_RATE:g}"
        raise InputError(f"{file}, Frame Time", f"{frame_time:g}", rule)
    fps = 1 / frame_time
    return float(round(fps)) if round(fps) and abs(fps / round(fps) - 1) < 5e-4 else fps


def _track(raw: RawBVH) -> Track:
    """Local rotations and translations of every joint, and of end sites that have a length."""
    frames = len(raw.values)
    kept = [i for i, node in enumerate(raw.nodes) if not node.end or np.any(node.offset or 0)]
    new = {old: i for i, old in enumerate(kept)} | {-1: -1}
    rotations = np.zeros((frames, len(kept), 4))
    rotations[..., 3] = 1
    translations = np.zeros((frames, len(kept), 3))
    first = np.cumsum([0] + [len(node.channels) for node in raw.nodes])
    for i, old in enumerate(kept):
        node = raw.nodes[old]
        translations[:, i] = node.offset or (0.0, 0.0, 0.0)
        values = raw.values[:, first[old] : first[old + 1]]
        turns = [c for c, (kind, _) in enumerate(node.channels) if kind == "rotation"]
        places = [c for c, (kind, _) in enumerate(node.channels) if kind == "position"]
        # Some programs declare position channels and never fill them; the OFFSET is then where the joint is.
        if i == 0 or np.any(values[:, places]):
            translations[:, i, [node.channels[c][1] for c in places]] = values[:, places]
        if turns:
            rotations[:, i] = euler_to_unitquat([node.channels[c][1] for c in turns], np.radians(values[:, turns]))
    parents = tuple(new[raw.nodes[old].parent] for old in kept)
    return Track(_unique([raw.nodes[old].name for old in kept]), parents, rotations, translations)


def _unique(names: list[str]) -> tuple[str, ...]:
    """The names, with a number where a file uses one twice."""
    seen: dict[str, int] = {}
    taken = set(names)
    result = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        label = name
        while seen[name] > 1 and label in taken:
            label = f"{name}_{seen[name]}"
            seen[name] += label in taken
        taken.add(label)
        result.append(label)
    return tuple(result)
