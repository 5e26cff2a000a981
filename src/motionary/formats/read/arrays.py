"""Motions as numpy files: .npy holds joint positions alone, .npz all that is known. Nothing is ever unpickled."""

from __future__ import annotations

import json
import os
import zipfile
from pathlib import Path

import numpy as np

from motionary.errors import InputError
from motionary.files import readable
from motionary.motion import Motion, Skeleton

_BARE = {22: "smpl22", 21: "kit21"}  # bare arrays carry no joint names: these two counts are known layouts
_DEFAULT_FPS = 20.0  # HumanML3D's rate, at which bare joint arrays are usually stored
_MOST_BYTES = 2**31


def read_npy(path: str | os.PathLike, fps: float | None = None, skeleton: Skeleton | None = None) -> Motion:
    """Read joint positions (T, J, 3) in metres, y up, of any float type.

    Args:
        path: the .npy file.
        fps: frames per second; 20 where not given.
        skeleton: needed unless J is 22 (SMPL order) or 21 (KIT order).

    Raises:
        InputError: not such an array; feature vectors (T, 263) are refused, they are not joints.
    """
    path = readable(path)
    try:
        with open(path, "rb") as file:
            array = np.lib.format.read_array(file, allow_pickle=False)
    except (ValueError, OSError, EOFError, MemoryError) as error:
        raise _unreadable(path, error) from None
    return _motion(path, array, fps, skeleton)


def read_npz(path: str | os.PathLike, fps: float | None = None, skeleton: Skeleton | None = None) -> Motion:
    """Read what `write_npz` wrote: positions, and where present rotations, fps and skeleton.

    Args:
        path: the .npz file.
        fps: overrides the file's own rate.
        skeleton: overrides the file's own skeleton.

    Raises:
        InputError: no positions in it, damaged, pickled objects, or more than 2 GB when unpacked.
    """
    path = readable(path)
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > _MOST_BYTES:
                raise InputError(path, "over 2 GB unpacked", "too large for one motion")
        with np.load(path, allow_pickle=False) as data:
            if "positions" not in data.files:
                raise InputError(path, f"holds {', '.join(data.files) or 'nothing'}", "must hold 'positions' (T, J, 3)")
            arrays = {key: data[key] for key in ("positions", "rotations", "fps", "skeleton") if key in data.files}
    except (ValueError, OSError, EOFError, MemoryError, KeyError, zipfile.BadZipFile, zipfile.LargeZipFile) as error:
        if isinstance(error, InputError):
            raise
        raise _unreadable(path, error) from None
    if fps is None and "fps" in arrays:
        fps = _number(path, arrays["fps"])
    if skeleton is None and "skeleton" in arrays:
        skeleton = _skeleton(path, arrays["skeleton"])
    return _motion(path, arrays["positions"], fps, skeleton, arrays.get("rotations"))


def _motion(
    path: Path, positions: np.ndarray, fps: float | None, skeleton: Skeleton | None, rotations: np.ndarray | None = None
) -> Motion:
    if positions.ndim != 3 or positions.shape[-1] != 3 or positions.dtype.kind not in "fiu":
        rule = "must be joint positions (T, J, 3)"
        if positions.ndim == 2:
            rule += "; feature vectors are decoded by motionary.features, not read as joints"
        raise InputError(path, f"{positions.dtype} {positions.shape}", rule)
    if skeleton is None:
        known = _BARE.get(positions.shape[1])
        if known is None:
            rule = "a bare array must have 22 (smpl22) or 21 (kit21) joints; otherwise give skeleton="
            raise InputError(path, f"{positions.shape[1]} joints", rule)
        skeleton = Skeleton.named(known)
    try:
        return Motion(
            positions=np.asarray(positions, np.float32),
            fps=_DEFAULT_FPS if fps is None else fps,
            skeleton=skeleton,
            rotations=None if rotations is None else np.asarray(rotations, np.float32),
        )
    except InputError as error:
        raise InputError(f"{path}, {error.what}", error.value, error.rule) from None


def _unreadable(path: Path, error: Exception) -> InputError:
    if "allow_pickle" in str(error):
        return InputError(path, "pickled objects", "never loaded: save plain arrays")
    return InputError(path, error or type(error).__name__, "not a readable numpy file (damaged or truncated?)")


def _number(path: Path, array: np.ndarray) -> float:
    if array.size != 1 or array.dtype.kind not in "fiu":
        raise InputError(f"{path}, fps", f"{array.dtype} {array.shape}", "must be one number")
    return float(array.reshape(()))


def _skeleton(path: Path, array: np.ndarray) -> Skeleton:
    try:
        return Skeleton.from_json(json.loads(str(array.reshape(()))))
    except InputError as error:
        raise InputError(f"{path}, {error.what}", error.value, error.rule) from None
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}, skeleton", error, "must be a skeleton as JSON text") from None
