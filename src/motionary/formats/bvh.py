"""BVH (Biovision hierarchy) in and out, with true local rotations."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from motionary.errors import InputError
from motionary.formats.bvh_text import Node, RawBVH, parse, render
from motionary.formats.euler import from_euler, to_zxy
from motionary.formats.files import read_text, write_bytes
from motionary.formats.rig import Track, to_locals, to_motion
from motionary.motion import Motion

_POSITIONS = [("position", axis) for axis in range(3)]
_ROTATIONS = [("rotation", axis) for axis in (2, 0, 1)]  # z x y, as most programs write


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


def write_bvh(motion: Motion, path: str | os.PathLike, unit: float = 0.01, force: bool = True) -> Path:
    """Write a BVH file with rotation channels Z X Y, the root's position, and positions where a joint moves besides.

    Without rotations they are fitted, and bones become constant (`motionary.motion.fit_rotations`).

    Args:
        motion: what to write.
        path: where.
        unit: metres per unit of the file; centimetres by default, which most programs expect.
        force: replace an existing file.

    Raises:
        InputError: the place cannot be written, or unit is not a positive number.
    """
    if not (np.isfinite(unit) and unit > 0):
        raise InputError("unit", unit, "must be metres per unit, above 0")
    local = to_locals(motion)
    skeleton = local.skeleton
    inner = set(skeleton.parents)
    nodes: list[Node] = []
    columns: list[list[np.ndarray]] = []
    angles = np.degrees(to_zxy(local.rotations))
    for j, (name, parent) in enumerate(zip(skeleton.joints, skeleton.parents, strict=True)):
        end = name.endswith("_end") and j not in inner and not local.moving[j]
        node = Node(name, parent, end, tuple(float(x) for x in skeleton.offsets[j] / unit))
        columns.append([])
        if local.moving[j]:
            node.channels += _POSITIONS
            columns[j].append(local.translations[:, j] / unit)
        if not end:
            node.channels += _ROTATIONS
            columns[j].append(angles[:, j])
        nodes.append(node)
    values = [part for j in _depth_first(skeleton.parents) for part in columns[j]]
    text = render(nodes, 1 / motion.fps, np.concatenate(values, axis=1))
    return write_bytes(path, text, force)


def _depth_first(parents: Sequence[int]) -> list[int]:
    """Joint indices in the order in which a BVH file nests them."""
    order, stack = [], [0]
    while stack:
        order.append(joint := stack.pop())
        stack += [j for j in range(len(parents) - 1, 0, -1) if parents[j] == joint]
    return order


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
            rotations[:, i] = from_euler([node.channels[c][1] for c in turns], np.radians(values[:, turns]))
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
