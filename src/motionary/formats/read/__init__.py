"""Readers of motion files: one per extension, loaded only when a file asks for it."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from motionary.errors import InputError, InputWarning
from motionary.formats.dispatch import foreseen, function_of, given
from motionary.formats.read.doubts import doubts_of
from motionary.formats.read.reading_options import Reading, ReadingOptions
from motionary.motion import Motion

READERS = {
    ".bvh": "motionary.formats.read.bvh:bvh_with",
    ".amc": "motionary.formats.read.acclaim:amc_with",
    ".npy": "motionary.formats.read.arrays:npy_with",
    ".npz": "motionary.formats.read.arrays:npz_with",
    ".glb": "motionary.formats.read.gltf_reader:gltf_with",
    ".gltf": "motionary.formats.read.gltf_reader:gltf_with",
    ".c3d": "motionary.formats.read.c3d_points:c3d_with",
}
# What other programs write, and the way to a file that is read.
_CONVERTED = {
    ".fbx": "in Blender File > Import > FBX, then File > Export > Motion Capture (.bvh), makes it one",
    ".blend": "in Blender File > Export > Motion Capture (.bvh) makes it one",
    ".trc": "it holds markers, not joints: solve them to a skeleton where they were recorded, and export BVH",
    ".vmd": "MMD's motion belongs to its model: load both in Blender and export BVH",
}
_FORMAT_OPTIONS = ("fps", "skeleton", "asf", "animation")

__all__ = ["READERS", "Reading", "ReadingOptions", "read_motion", "read_motion_warning", "read_motion_with"]


def read_motion(
    path: str | os.PathLike, mapping: Path | str | Mapping[str, Any] | None = None, **options: Any
) -> Motion:
    """Read a motion file by its extension: .bvh, .amc (with its .asf), .npy, .npz, .glb, .gltf, .c3d.

    Which axis points up, how long a unit is and whether left and right are swapped is measured on the whole file. Where
    the evidence is thin or contradicts itself, one `InputWarning` says what was taken and how to say otherwise.

    Args:
        path: the file.
        mapping: the joint's name by role, for a rig that is not known (a dict or a JSON file); it may hold the keys
            ``up``, ``unit``, ``mirror``, ``skip_first`` and ``body`` too. See :func:`motionary.motion.name_joints`.
        options: ``up``, ``unit``, ``mirror``, ``skip_first`` and ``body`` (see `ReadingOptions`) and ``fps`` for all
            formats, ``skeleton`` for arrays, ``asf`` for AMC, ``animation`` (its name) for glTF. ``progress=True``
            shows a bar while a long text file is read. None means not given.

    Returns:
        The motion in metres, y up.

    Raises:
        InputError: unknown extension, or a file that breaks a rule: file, value and rule in one line.
    """
    return read_motion_warning(path, mapping, **options)[0]


def read_motion_warning(
    path: str | os.PathLike, mapping: Path | str | Mapping[str, Any] | None = None, **options: Any
) -> tuple[Motion, Reading]:
    """`read_motion`, and how the file was read."""
    motion, reading = read_motion_with(path, mapping, **options)
    if reading.notes:
        warnings.warn(InputWarning(f"{path}: {'; '.join(reading.notes)}"), stacklevel=3)
    return motion, reading


def read_motion_with(
    path: str | os.PathLike,
    mapping: Path | str | Mapping[str, Any] | ReadingOptions | None = None,
    **options: Any,
) -> tuple[Motion, Reading]:
    """`read_motion`, and how the file was read; it warns of nothing (see `Reading.notes`), and `mapping` may be the
    options."""
    _check_file(path)
    if (extension := Path(path).suffix.lower()) in _CONVERTED:
        raise InputError(path, extension, f"only {' '.join(READERS)} can be read; {_CONVERTED[extension]}")
    reader = function_of(path, READERS, "read")
    said = {key: value for key, value in options.items() if key not in _FORMAT_OPTIONS and value is not None}
    known = ReadingOptions.__dataclass_fields__
    if unknown := {key: value for key, value in said.items() if key not in known}:
        given(reader, path, unknown)  # which refuses them
    how = ReadingOptions(**said)
    if mapping is not None:
        how = how.over(mapping if isinstance(mapping, ReadingOptions) else ReadingOptions.from_mapping(mapping))
    extra = given(reader, path, {key: value for key, value in options.items() if key in _FORMAT_OPTIONS})
    motion, reading = _read(reader, Path(path), how, extra)
    told = tuple(dict.fromkeys((*reading.told, *(["mapping"] if how.mapping else []))))
    notes = reading.notes
    if how.body is not None and "body" not in told:
        notes = (*notes, "the body model was left aside: only SMPL poses, as AMASS has them, are read on one")
    return motion, replace(reading, told=told, notes=notes)


def _check_file(path: object) -> None:
    """InputError for what is no path, and for a folder; it says how to read what lies there."""
    if not isinstance(path, str | os.PathLike):
        raise InputError("path", path, "must be the path of a motion file")
    if os.path.isdir(path):
        suffix = next((name for name in READERS if any(Path(path).glob(f"*{name}"))), next(iter(READERS)))
        rule = f"must be a file; name those in it, as {path}/*{suffix}, or take all of them: motionary index {path}"
        raise InputError(path, "a folder", rule)


def _read(
    reader: Callable[..., tuple[Motion, Reading]], path: Path, how: ReadingOptions, extra: dict[str, Any]
) -> tuple[Motion, Reading]:
    """What the reader gives; its complaints name the file."""
    try:
        with foreseen(path, "cannot be read as a motion (damaged?)"):
            motion, reading = reader(path, options=how, **extra)
            notes = doubts_of(motion, extra.get("fps") is not None)
            return motion, replace(reading, notes=(*reading.notes, *notes))
    except InputError as error:
        if str(path) in error.what or getattr(how.mapping, "where", "mapping") in error.what:
            raise
        raise InputError(f"{path}: {error.what}", error.value, error.rule) from None
