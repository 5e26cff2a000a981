"""BVH (Biovision hierarchy) in and out, with true local rotations."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.formats.animated_rig import Track, unique_names
from motionary.formats.bvh_text import Node, RawBVH, parse
from motionary.formats.number_rows import reading_bar
from motionary.formats.read.frame_rate import USUAL, rate_of
from motionary.formats.read.reading_options import Reading, ReadingOptions
from motionary.formats.tracks import to_motion
from motionary.motion import Motion
from motionary.motion.motion import FASTEST_RATE, SLOWEST_RATE
from motionary.motion.rotations import euler_to_unitquat
from motionary.text_files import text_stream

_DISPLACED = 0.25  # channels below the root shorter than this part of the OFFSET are no places of joints
_SEVERAL = 3  # joints; one may be a pelvis that moves below a placement node
_NEAR = 0.08  # of a body's extent: what lies so near to the ground is on it
_LOOKS = 50  # frames that tell where the ground is
_ROOT_ADDED = (
    "the root's position channels put its feet on the ground only with its OFFSET: they were added to it "
    "(say otherwise by an OFFSET of 0 in the file)"
)
_ROOT_UNSURE = (
    "the root has an OFFSET, and position channels that say other places: these were taken as they are, without it "
    "(say otherwise by adding the OFFSET to them in the file)"
)
_STIFF = 1.0  # degrees; a body that turns no joint farther does not move
_RADIANS = (
    "all angles lie within 2 pi and were read as degrees, so that the body hardly leaves its rest pose: where they are "
    "radians, turn them into degrees in the file"
)
_LONGEST_FRAME = 1 / SLOWEST_RATE  # s; slower than that is no recording of motion, but a rate in another unit


def read_bvh(path: str | os.PathLike, fps: float | None = None, **options: Any) -> Motion:
    """The motion of `bvh_with`; options are those of `ReadingOptions`."""
    return bvh_with(path, ReadingOptions(**options), fps)[0]


def bvh_with(
    path: str | os.PathLike, options: ReadingOptions | None = None, fps: float | None = None
) -> tuple[Motion, Reading]:
    """Read a BVH file: any channel order, rotation and position channels on any joint, end sites; and how it was read.

    Every joint stays, helpers and fingers too; end sites that have a length become joints named ``<parent>_end``.
    Position channels replace a joint's OFFSET, unless they are zero through the whole file or are displacements from
    it; the root's are added to its OFFSET where only that puts it on the ground. Rotations are the file's own; where a
    joint other than the root also moves, positions are true and rotations alone do not reproduce them.

    Args:
        path: the file.
        options: what the user knows of the file.
        fps: overrides the file's frame time.

    Raises:
        InputError: unreadable, truncated, wrong counts, or numbers that are not finite: file, line and rule.
    """
    options = options or ReadingOptions()
    with text_stream(path) as file, reading_bar(file, path, options.progress) as told:
        raw = parse(file, path, told)
        rate = _rate(raw, path) if fps is None else fps
        track = track_of(raw)
    motion, reading = to_motion(track, rate, path, options)
    return motion, replace(reading, notes=(*raw.notes, *reading.notes))


def _rate(raw: RawBVH, file: object) -> float:
    """Frames per second that the file's rounded frame time means (.0083333 is 120)."""
    frame_time = raw.frame_time
    if frame_time > _LONGEST_FRAME:
        rule = f"must be seconds per frame, at most {_LONGEST_FRAME:g}"
        if frame_time < 1100:
            rate = f", or a rate? then fps={frame_time:g}" if frame_time in USUAL else ""
            rule += f" (milliseconds? then say fps={1000 / frame_time:.4g}{rate}; --fps)"
        raise InputError(f"{file}, Frame Time", f"{frame_time:g}", rule)
    if frame_time < 1 / FASTEST_RATE:
        rule = f"must be seconds per frame, at least {1 / FASTEST_RATE:g}"
        raise InputError(f"{file}, Frame Time", f"{frame_time:g}", rule)
    fps, doubt = rate_of(frame_time, raw.rounded)
    raw.notes += [doubt] if doubt else []
    return fps


def track_of(raw: RawBVH) -> Track:
    """Local rotations and translations of every joint, and of end sites that have a length; reads the file's rows."""
    kept = [i for i, node in enumerate(raw.nodes) if not node.end or np.any(node.offset or 0)]
    new = {old: i for i, old in enumerate(kept)} | {-1: -1}
    nodes = [raw.nodes[old] for old in kept]
    first = np.cumsum([0] + [len(node.channels) for node in raw.nodes])[kept]
    turns, places = _columns(nodes, first, "rotation"), _columns(nodes, first, "position")
    offsets = np.array([node.offset or (0.0, 0.0, 0.0) for node in nodes])
    rotations = np.empty((raw.frames, len(nodes), 4), np.float32)
    moves = {joint: np.empty((raw.frames, 3)) for _, joints, _ in places for joint in joints}
    frames, filled, widest = 0, set(), 0.0
    for rows in raw.rows:
        start, frames = frames, frames + len(rows)
        if frames > len(rotations):  # more than the file says
            rotations = _longer(rotations, frames)
            moves = {joint: _longer(array, frames) for joint, array in moves.items()}
        rotations[start:frames] = (0, 0, 0, 1)
        for axes, joints, columns in turns:
            widest = max(widest, float(np.abs(rows[:, columns]).max(initial=0)))
            rotations[start:frames, joints] = euler_to_unitquat(axes, np.radians(rows[:, columns]))
        for axes, joints, columns in places:
            for joint, of_joint in zip(joints, columns, strict=True):
                moves[joint][start:frames] = offsets[joint]
                moves[joint][start:frames, axes] = rows[:, of_joint]
                # Some programs declare position channels and never fill them; the OFFSET is then where the joint is.
                if joint == 0 or joint in filled or rows[:, of_joint].any():
                    filled.add(joint)
    moved = {joint: moves[joint][:frames] for joint in sorted(filled)}
    if below := _displaced(moved, offsets):
        for joint in below:
            moved[joint] += offsets[joint]
        raw.notes.append("position channels below the root are far shorter than the bones; they were added to OFFSET")
    if _STIFF < widest <= 2 * np.pi:
        raw.notes.append(_RADIANS)
    parents = tuple(new[node.parent] for node in nodes)
    track = Track(unique_names([node.name for node in nodes]), parents, rotations[:frames], offsets, moved)
    places_root = sum(kind == "position" for kind, _ in nodes[0].channels) == 3
    if places_root and (added := _root_added(track)) is not False:
        raw.notes.append(_ROOT_ADDED if added else _ROOT_UNSURE)
        moved[0] += offsets[0] if added else 0
    return track


def _root_added(track: Track) -> bool | None:
    """Whether the root's position channels say how far it is from its OFFSET; None where that cannot be told.

    By the format they say where it is, and some programs add them. An OFFSET is mostly where the root stands over the
    ground: the lowest joints lie at zero along it if it is added, and far below if it is not.
    """
    offset = track.offsets[0]
    if not offset.any() or not np.isfinite(height := float(np.linalg.norm(offset))):
        return False
    some = np.unique(np.linspace(0, len(track.rotations) - 1, _LOOKS).astype(int))
    moves = {joint: places[some] for joint, places in track.moves.items()}
    points = replace(track, rotations=track.rotations[some], moves=moves).place()
    near = _NEAR * float(np.median(np.ptp(points, axis=1).max(-1)))
    ground = float(np.median((points @ (offset / height)).min(axis=1)))
    if height <= near or np.linalg.norm(moves[0][0] - offset) <= near or abs(ground) <= near:
        return False
    return True if abs(ground + height) <= near else None


def _displaced(moved: dict[int, np.ndarray], offsets: np.ndarray) -> list[int]:
    """The joints below the root, of places (T, 3), whose channels say how far a joint is from its OFFSET.

    By the format they say where it is; those who take them for displacements write next to nothing for stiff bones.
    """
    lengths = np.linalg.norm(offsets, axis=-1)
    below = [joint for joint in moved if joint and lengths[joint] > 0]
    apart = [np.median(np.linalg.norm(moved[joint], axis=-1)) / lengths[joint] for joint in below]
    return below if len(below) >= _SEVERAL and np.median(apart) < _DISPLACED else []


def _columns(nodes: list[Node], first: np.ndarray, kind: str) -> list[tuple[list[int], list[int], np.ndarray]]:
    """For joints with the same channels of a kind: their axes, the joints, and the channels' columns (joints, axes)."""
    found: dict[tuple[int, ...], tuple[list[int], list[list[int]]]] = {}
    for joint, node in enumerate(nodes):
        if at := [c for c, (what, _) in enumerate(node.channels) if what == kind]:
            joints, columns = found.setdefault(tuple(node.channels[c][1] for c in at), ([], []))
            joints.append(joint)
            columns.append([int(first[joint]) + c for c in at])
    return [(list(axes), joints, np.array(columns)) for axes, (joints, columns) in found.items()]


def _longer(array: np.ndarray, frames: int) -> np.ndarray:
    """With room for that many, and at least twice as many as before."""
    more = max(frames - len(array), len(array))
    return np.concatenate([array, np.empty((more, *array.shape[1:]), array.dtype)])
