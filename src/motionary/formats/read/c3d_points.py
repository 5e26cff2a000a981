"""Joints in C3D files, the format of optical motion capture: labelled points over time.

Only points whose labels name joints make a motion: by the names of a known rig, by a mapping, or as the joint centres
that Plug-in Gait writes beside its markers. Markers on the skin are refused: where a joint lies below them is for the
program that recorded them to solve. The library `c3d` reads the file.
"""

from __future__ import annotations

import os
import warnings
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.files import readable
from motionary.formats.measure import UNITS
from motionary.formats.read.extent import check_extent
from motionary.formats.read.gaps import filled, unseen
from motionary.formats.read.reading_options import Reading, ReadingOptions
from motionary.formats.read.settle import Settled, settle, with_roles
from motionary.motion import Motion, Skeleton
from motionary.motion.rigs import REQUIRED, find_roles
from motionary.motion.roles import read_mapping

_SHOWN = 8  # labels in a message
_WORDS = {"millimeters": "mm", "centimeters": "cm", "meters": "m", "metres": "m", "inches": "in"}
_USUAL = {
    "up": {"y": 0.5, "z": 1.0, "-y": -1.0, "-z": -1.0, "x": -1.0, "-x": -1.0},  # laboratories have z up, studios y
    "unit": {"mm": 1.0, "m": 0.0, "cm": 0.0, "dm": -2.0, "in": -1.0, "ft": -3.0, "cmu": -4.0},
}
_NAMED = 3.0  # log-odds in favour of the unit that the file names


def c3d_with(
    path: str | os.PathLike, options: ReadingOptions | None = None, fps: float | None = None
) -> tuple[Motion, Reading]:
    """Read the joints of one person from a C3D file.

    A joint has no place where its residual says so, and where it is exactly zero, as many programs write. Frames at
    both ends in which one has none are left out; gaps between are filled on a straight line; both are said. A pelvis
    that is not there lies between the hips.

    Args:
        path: the .c3d file.
        options: what the user knows of the file; a `mapping` names labels.
        fps: overrides the file's own rate.

    Returns:
        The motion, metres, y up, on the joints of SMPL's body that the file has; and how it was read.

    Raises:
        InputError: no C3D file or a damaged one, labels that name no joints, several people, a joint that has no place
            in most frames.
    """
    path, options = readable(path), options or ReadingOptions()
    with path.open("rb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the library's, about analog channels and the like
        reader = _opened(path, file)
        labels = [str(label).strip() for label in reader.point_labels][: reader.point_used]
        frames = reader.frame_count
        claimed = f"{len(labels)} points, {frames} frames"
        check_extent(path, claimed, max(frames, 0) * len(labels), path.stat().st_size)
        roles = _roles(path, labels, options.mapping)
        places = _places(reader, [*roles.values()])
        if len(places) < frames:
            raise InputError(path, f"{len(places)} frames of {frames}", "must be whole, the file is cut")
        rate = float(reader.point_rate) if fps is None else fps
        unit = _text(reader, "POINT:UNITS").lower()
    names = list(roles)
    gone = ~np.isfinite(places[..., 0]) | unseen(places, {name: i for i, name in enumerate(names)})
    _, places, notes = filled(path, places, gone, names)
    if "pelvis" not in names:
        hips = [names.index("left_hip"), names.index("right_hip")]
        places, names = np.concatenate([places[:, hips].mean(1, keepdims=True), places], axis=1), ["pelvis", *names]
    usual = {**_USUAL, "unit": {**_USUAL["unit"], **_favoured(unit)}}
    settled = settle(places, {name: i for i, name in enumerate(names)}, rate, options, usual=usual)
    settled = with_roles(settled, "names" if options.mapping is None else "mapping", notes)
    return _motion(places, names, rate, settled, bool(options.skip_first))


def _opened(path: Path, file: Any) -> Any:
    import c3d

    try:
        return c3d.Reader(file)
    except Exception as error:  # of any kind: the library believes what a damaged file says of itself
        raise InputError(path, f"{type(error).__name__}: {error}", "must be a C3D file (damaged?)") from None


def _text(reader: Any, name: str) -> str:
    found = reader.get(name)
    return found.string_value.strip() if found is not None else ""


def _favoured(unit: str) -> dict[str, float]:
    unit = _WORDS.get(unit, unit)
    return {unit: _NAMED} if unit in UNITS else {}


def _roles(path: Path, labels: Sequence[str], mapping: Mapping[str, str] | None) -> dict[str, int]:
    """Label by role, in SMPL's order; of one person. A pelvis may be missing."""
    people: dict[str, list[int]] = defaultdict(list)
    for i, label in enumerate(labels):
        people[label.rpartition(":")[0]].append(i)
    found = {}
    given = {} if mapping is None else read_mapping(mapping, tuple(labels))
    for person, own in people.items():
        known = find_roles(tuple(labels[i] for i in own))
        roles = {role: own[i] for role, i in known.items()} | {r: i for r, i in given.items() if i in own}
        if set(REQUIRED) - {"pelvis"} <= set(roles):
            found[person] = roles
    if len(found) > 1:
        raise InputError(path, f"{len(found)} people: {', '.join(found)}", "must hold one; export each to a file")
    if not found:
        some = ", ".join(labels[:_SHOWN]) + (", ..." if len(labels) > _SHOWN else "")
        rule = "labels must name joints; markers on the skin are none: solve them to a skeleton where they were "
        rule += "recorded and export BVH, or say which labels are joints with --mapping"
        raise InputError(path, f"{len(labels)} points: {some}", rule)
    (roles,) = found.values()
    order = Skeleton.named("smpl22").joints
    return {role: roles[role] for role in order if role in roles}


def _places(reader: Any, points: list[int]) -> np.ndarray:
    """(T, J, 3) of these points, NaN where one has no place."""
    rows = []
    for _, frame, _ in reader.read_frames(copy=False):
        row = frame[points].astype(np.float64)
        missing = (row[:, 3] < 0) | ~np.isfinite(row[:, :3]).all(1)  # a residual of -1: not seen
        rows.append(np.where(missing[:, None], np.nan, row[:, :3]))
    return np.stack(rows) if rows else np.empty((0, len(points), 3))


def _motion(
    places: np.ndarray, names: Sequence[str], rate: float, settled: Settled, skip_first: bool
) -> tuple[Motion, Reading]:
    """The motion on a skeleton of SMPL's directions and the person's lengths."""
    points = settled.points(places)
    if skip_first and len(points) > 1:
        points = points[1:]
    smpl = Skeleton.named("smpl22")
    kept = [smpl.joints.index(name) for name in names]
    parents, offsets = [-1], [np.zeros(3)]
    for joint in range(1, len(kept)):
        above = smpl.parents[kept[joint]]
        while above not in kept:
            above = smpl.parents[above]
        parents.append(kept.index(above))
        bone = smpl.rest[kept[joint]] - smpl.rest[above]
        length = np.median(np.linalg.norm(points[:, joint] - points[:, parents[-1]], axis=-1))
        offsets.append(bone / np.linalg.norm(bone) * length)
    skeleton = Skeleton.from_rig("c3d", names, parents, np.stack(offsets))
    reading = replace(settled.reading, skipped_first=skip_first)
    return Motion(points.astype(np.float32), rate, skeleton), reading
