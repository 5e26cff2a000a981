"""BVH (Biovision hierarchy) in and out, with true local rotations."""

from __future__ import annotations

import os

import numpy as np

from motionary.files import read_text
from motionary.formats.bvh_text import RawBVH, parse
from motionary.formats.tracks import Track, to_motion
from motionary.motion import Motion
from motionary.motion.rotations import euler_to_unitquat


def read_bvh(
    path: str | os.PathLike,
    unit: str | float | None = None,
    up: str | None = None,
    skip_first: bool | None = None,
    fps: float | None = None,
) -> Motion:
    """Read a BVH file: any channel order, rotation and position channels on any joint, end sites.

    Every joint stays, helpers and fingers too; end sites that have a length become joints named ``<parent>_end``.
    Position channels replace a joint's OFFSET. Rotations are the file's own; where a joint other than the root also
    moves, positions are true and rotations alone do not reproduce them.

    Args:
        path: the file.
        unit: metres per unit or "m", "cm", "mm", "in", "cmu"; None finds it by the length of the legs.
        up: "y" or "z"; None finds it.
        skip_first: drop the first frame; None drops it where it is a T-pose from which the motion jumps away.
        fps: overrides the file's frame time.

    Raises:
        InputError: unreadable, truncated, wrong counts, or numbers that are not finite: file, line and rule.
    """
    raw = parse(read_text(path), path)
    return to_motion(_track(raw), _rate(raw.frame_time) if fps is None else fps, path, unit, up, skip_first)


def _rate(frame_time: float) -> float:
    """Frames per second; a whole number where the file's rounded frame time means one (.0083333 is 120)."""
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
        for c, (kind, axis) in enumerate(node.channels):
            if kind == "position":
                translations[:, i, axis] = values[:, c]
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
