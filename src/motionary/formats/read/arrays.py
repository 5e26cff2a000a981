"""Motions as numpy files: .npy holds joint positions alone, .npz all that is known. Nothing is ever unpickled."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from motionary.errors import InputError
from motionary.files import readable
from motionary.formats.read.gaps import MOST_MISSING, filled, unseen
from motionary.formats.read.numpy_files import NUMBERS, TEXT, ArrayArchive, read_npy
from motionary.formats.read.reading_options import Reading, ReadingOptions
from motionary.formats.read.settle import settle, with_roles
from motionary.formats.read.smpl import smpl_arrays, smpl_motion
from motionary.motion import Motion, Skeleton, name_joints

# Bare arrays carry no joint names: these counts are known layouts. SMPL's 24, SMPL-H's 52, SMPL-X's 55 and what the
# smplx package gives of SMPL-X (127, 144) begin with the body's 22.
_BARE = {22: "smpl22", 24: "smpl22", 52: "smpl22", 55: "smpl22", 127: "smpl22", 144: "smpl22", 21: "kit21"}
_FEATURES = {263: ("smpl22", 20.0), 251: ("kit21", 12.5)}
_LOWEST, _HIGHEST = 0.05, 2000.0  # root heights of raw features, in metres or (KIT-ML) millimetres
_OFF_AXES = 0.35  # by how much a rotation's axes may miss their length 1 on average, in features that a model made
_NORMALISED = "normalised ones need x * Std + Mean first"
_DEFAULT_FPS = 20.0  # HumanML3D's rate, at which bare joint arrays are usually stored
_FRAMES = 50  # enough to know how long bones are
_SAME = 0.01  # metres by which bones of one body differ at most
_OURS = ReadingOptions(up="y", unit=1.0, mirror=False)
# Bare arrays are nearly always in metres and y up, HumanML3D's way.
_USUAL = {
    "up": {"y": 1.5, "z": 0.5},
    "unit": {"m": 1.0, "mm": 0.0, "cm": 0.0, "dm": -2.0, "in": -1.5, "ft": -3.0, "cmu": -4.0},
}


def npy_with(
    path: str | os.PathLike,
    options: ReadingOptions | None = None,
    fps: float | None = None,
    skeleton: Skeleton | None = None,
) -> tuple[Motion, Reading]:
    """Read joint positions (T, J, 3) of any float type, or HumanML3D features (T, 263), KIT-ML's (T, 251).

    A batch of one (1, T, J, 3) and the order (J, 3, T) are read too; of SMPL's 24 joints, SMPL-H's 52 and SMPL-X's 55,
    127 or 144 the first 22, the body, are kept. Frames at both ends that hold no body, as padding, are left out; gaps
    between are filled on straight lines; both are said.

    Args:
        path: the .npy file.
        options: what the user knows of the file.
        fps: frames per second; 20 where not given (KIT-ML features: 12.5).
        skeleton: needed unless J is one of these (SMPL order) or 21 (KIT order).

    Raises:
        InputError: not such an array.
    """
    path = readable(path)
    options = options or ReadingOptions()
    array = _unpacked(path, read_npy(path), skeleton)
    if array.ndim == 2:
        return _decoded(path, array, fps, options)
    return _on_its_body(_motion(path, array, fps, skeleton, options))


def npz_with(
    path: str | os.PathLike,
    options: ReadingOptions | None = None,
    fps: float | None = None,
    skeleton: Skeleton | None = None,
) -> tuple[Motion, Reading]:
    """Read what `write_npz` wrote (positions, and where present rotations, fps and skeleton), or AMASS's SMPL poses.

    A file with a skeleton of ours is in metres, y up, and is not measured.

    Args:
        path: the .npz file.
        options: what the user knows of the file.
        fps: overrides the file's own rate.
        skeleton: overrides the file's own skeleton.

    Raises:
        InputError: no positions nor poses in it, damaged, pickled objects, or more than a file of its size can hold.
    """
    path, options = readable(path), options or ReadingOptions()
    arrays = _arrays(path, options.body is not None)
    if "positions" not in arrays:
        return smpl_motion(path, arrays, fps, options)
    if fps is None and "fps" in arrays:
        fps = _number(path, arrays["fps"])
    if skeleton is None and "skeleton" in arrays:
        skeleton = _skeleton(path, arrays["skeleton"])
        options = options.over(_OURS)
    positions = _unpacked(path, arrays["positions"], skeleton)
    if positions.ndim != 3:
        raise _shape_error(path, positions)
    found = _motion(path, positions, fps, skeleton, options, arrays.get("rotations"))
    return found if "skeleton" in arrays or "rotations" in arrays else _on_its_body(found)


def _arrays(path: Path, betas: bool) -> dict[str, np.ndarray]:
    """The arrays that are looked at: positions and what belongs to them, else SMPL poses, with `betas` where asked."""
    with ArrayArchive(path) as archive:
        names = archive.names
        wanted = ("positions", "rotations", "fps", "skeleton") if "positions" in names else smpl_arrays(names)
        if not wanted:
            rule = "must hold 'positions' (T, J, 3), or SMPL's 'poses' and 'trans' as AMASS does"
            raise InputError(path, f"holds {', '.join(names) or 'nothing'}", rule)
        wanted += ("betas",) if betas and "positions" not in names else ()
        return {key: archive.read(key, TEXT if key == "skeleton" else NUMBERS) for key in wanted if key in names}


def _unpacked(path: Path, array: np.ndarray, skeleton: Skeleton | None) -> np.ndarray:
    """(T, J, 3) or (T, D) of the shapes that programs write."""
    if array.dtype.kind not in "fiu":
        raise _shape_error(path, array)
    if array.ndim == 4 and array.shape[-1] != 3 and array.shape[-2] == 3:
        array = array.transpose(0, 3, 1, 2)  # (B, J, 3, T)
    if array.ndim in (3, 4) and array.shape[0] == 1 and (array.ndim == 4 or array.shape[-1] in _FEATURES):
        array = array[0]
    if array.ndim == 4:
        rule = "holds several motions: save one a file, as (T, J, 3)"
        raise InputError(path, f"{array.dtype} {array.shape}", rule)
    counts = {*_BARE, *([] if skeleton is None else [len(skeleton)])}
    if array.ndim == 3 and array.shape[1] == 3 and array.shape[0] in counts and array.shape[1:] != (3, 3):
        array = array.transpose(2, 0, 1)  # (J, 3, T)
    good = array.shape[-1] == 3 if array.ndim == 3 else array.ndim == 2 and array.shape[-1] in _FEATURES
    if not good or array.size == 0:
        raise _shape_error(path, array)
    return array


def _shape_error(path: Path, array: np.ndarray) -> InputError:
    rule = "must be joint positions (T, J, 3), or features (T, 263) or (T, 251)"
    return InputError(path, f"{array.dtype} {array.shape}", rule)


def _decoded(path: Path, array: np.ndarray, fps: float | None, options: ReadingOptions) -> tuple[Motion, Reading]:
    """The motion of raw HumanML3D features: metres, y up, by their definition."""
    from motionary.features import HumanML3D

    name, usual_fps = _FEATURES[array.shape[-1]]
    height = float(np.median(array[:, 3]))
    if not np.isfinite(array).all() or not _LOWEST < height < _HIGHEST:
        rule = f"features must be raw, with the root {_LOWEST:g} to {_HIGHEST:g} m high (mm in KIT-ML); "
        raise InputError(path, f"root height {height:.3g}", rule + _NORMALISED)
    codec = HumanML3D(Skeleton.named(name))
    axes = np.linalg.norm(array[:, codec.slices["rotations"]].reshape(len(array), -1, 3).astype(np.float64), axis=-1)
    if axes.any() and (off := float(np.abs(axes - 1).mean())) > _OFF_AXES:  # all zero where a program leaves them out
        rule = "features must be raw, with rotations as unit vectors; "
        raise InputError(path, f"vectors {off:.2g} longer or shorter than 1", rule + _NORMALISED)
    motion = codec.decode(array.astype(np.float32), fps=usual_fps if fps is None else fps)
    told = ReadingOptions(up="y", mirror=False)  # by their definition; KIT-ML's are in millimetres
    return _motion(path, motion.positions, motion.fps, motion.skeleton, options.over(told))


def _motion(
    path: Path,
    positions: np.ndarray,
    fps: float | None,
    skeleton: Skeleton | None,
    options: ReadingOptions,
    rotations: np.ndarray | None = None,
) -> tuple[Motion, Reading]:
    if skeleton is None:
        known = _BARE.get(positions.shape[1])
        if known is None:
            rule = "a bare array must have 22, 24, 52 or 55 (SMPL) or 21 (kit21) joints; otherwise give skeleton="
            raise InputError(path, f"{positions.shape[1]} joints", rule)
        skeleton = Skeleton.named(known)
        positions = positions[:, : len(skeleton)]
    if skeleton.codec_swaps_sides:
        options = options.over(ReadingOptions(mirror=False))  # its released joints live in a mirrored world
    fps = _DEFAULT_FPS if fps is None else fps
    try:
        positions, rotations, notes = _whole(np.asarray(positions, np.float32), rotations, skeleton)
        motion = Motion(positions, fps, skeleton, rotations)
        if options.mapping is not None:
            motion = name_joints(motion, options.mapping)
        motion, reading = settled_motion(motion, options, _USUAL)
        return motion, replace(reading, notes=(*notes, *reading.notes))
    except InputError as error:
        raise InputError(f"{path}, {error.what}", error.value, error.rule) from None


def _whole(
    positions: np.ndarray, rotations: np.ndarray | None, skeleton: Skeleton
) -> tuple[np.ndarray, np.ndarray | None, list[str]]:
    """Positions (T, J, 3) and rotations of frames that hold a body, and what to say of others: batches of motions are
    padded with zeros. A joint that lies at zero most of the time is left there."""
    if positions.shape[1] != len(skeleton):
        return positions, rotations, []  # which Motion refuses
    gone = unseen(positions, skeleton.roles)
    empty = gone.all(1)
    if empty.all() or not gone.any():
        return positions, rotations, []
    gone[:, gone[~empty].mean(0) > MOST_MISSING] = False
    gone[empty] = True
    kept, positions, notes = filled("positions", positions, gone, skeleton.joints)
    if rotations is not None:
        rotations = None if gone[kept].any() else rotations[kept]
    return positions, rotations, notes


def _on_its_body(found: tuple[Motion, Reading]) -> tuple[Motion, Reading]:
    """The motion with a skeleton of the lengths that its bones have: a layout says how joints hang together, and not
    whose they are. Where they differ by less than a centimetre, the layout's own skeleton stays."""
    motion, reading = found
    some = np.unique(np.linspace(0, motion.frames - 1, _FRAMES).astype(int))
    skeleton, joints = motion.skeleton, motion.positions[some].astype(np.float64)
    bones = np.linalg.norm(joints[:, 1:] - joints[:, list(skeleton.parents[1:])], axis=-1)
    lengths, own = np.median(bones, axis=0), skeleton.bone_lengths[1:]
    if np.abs(lengths - own).max(initial=0) < _SAME or not (own > 0).all():
        return found
    offsets = skeleton.offsets.copy()
    offsets[1:] *= (lengths / own)[:, None]
    return Motion(motion.positions, motion.fps, skeleton.with_offsets(offsets), motion.rotations), reading


def settled_motion(
    motion: Motion, options: ReadingOptions, usual: dict[str, dict[str, float]]
) -> tuple[Motion, Reading]:
    """A motion whose positions and rotations are a file's, in metres, y up; and how it was read.

    Its skeleton is a known one and keeps its rest pose: only the world is turned, scaled and mirrored.
    """
    settled = settle(motion.positions, dict(motion.skeleton.roles), motion.fps, options, usual=usual)
    reading = settled.reading
    source = "mapping" if options.mapping is not None else "names" if motion.skeleton.roles else "unknown"
    settled = with_roles(settled, source, [])
    positions, rotations = motion.positions, motion.rotations
    if (reading.up, reading.unit, reading.mirrored) != ("y", 1.0, False):
        positions = settled.points(positions.astype(np.float64)).astype(np.float32)
        rotations = None  # they belong to the axes and the rest pose that they were written with
    if options.skip_first and len(positions) > 1:
        positions, rotations = positions[1:], None if rotations is None else rotations[1:]
    reading = replace(settled.reading, skipped_first=bool(options.skip_first))
    return Motion(positions, motion.fps, motion.skeleton, rotations), reading


def _number(path: Path, array: np.ndarray) -> float:
    if array.size != 1 or array.dtype.kind not in "fiu":
        raise InputError(f"{path}, fps", f"{array.dtype} {array.shape}", "must be one number")
    return float(array.reshape(()))


def _skeleton(path: Path, array: np.ndarray) -> Skeleton:
    try:
        return Skeleton.from_json(json.loads(str(array.reshape(()))))
    except InputError as error:
        raise InputError(f"{path}, {error.what}", error.value, error.rule) from None
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"{path}, skeleton", error, "must be a skeleton as JSON text") from None
