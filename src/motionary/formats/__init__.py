"""Motion files: one reader and one writer per extension, loaded only when a file asks for them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from importlib import import_module
from inspect import Parameter, signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motionary.errors import InputError

if TYPE_CHECKING:
    from motionary.motion import Motion

READERS = {
    ".bvh": "bvh.read_bvh",
    ".amc": "acclaim.read_amc",
    ".npy": "arrays.read_npy",
    ".npz": "arrays.read_npz",
}
WRITERS = {
    ".bvh": "bvh.write_bvh",
    ".npy": "arrays.write_npy",
    ".npz": "arrays.write_npz",
    ".glb": "gltf.write_glb",
    ".mp4": "video.write_video",
    ".gif": "video.write_video",
    ".html": "page.write_page",
}


def read_motion(
    path: str | os.PathLike, mapping: Path | str | Mapping[str, str] | None = None, **options: Any
) -> Motion:
    """Read a motion file by its extension: .bvh, .amc (with its .asf), .npy, .npz.

    Args:
        path: the file.
        mapping: for a rig that is not known, its joint's name by role (a dict or a JSON file): see
            :func:`motionary.motion.name_joints`.
        options: for that format; ``fps`` for all, ``skeleton`` for arrays, ``unit``, ``up`` and ``skip_first`` for BVH
            and AMC, ``asf`` for AMC. None means not given.

    Returns:
        The motion in metres, y up.

    Raises:
        InputError: unknown extension, or a file that breaks a rule: file, value and rule in one line.
    """
    reader = _function(path, READERS, "read")
    motion = reader(path, **_known(reader, path, options))
    if mapping is None:
        return motion
    from motionary.motion import name_joints

    return name_joints(motion, mapping)


def write_motion(motion: Motion, path: str | os.PathLike, force: bool = True, **options: Any) -> Path:
    """Write a motion by the path's extension: .bvh .npy .npz .glb .mp4 .gif .html. A file is whole or not there.

    Args:
        motion: what to write.
        path: where; missing folders are made.
        force: replace an existing file.
        options: for that format: ``unit`` for BVH, ``mesh`` for glb, ``captions`` for mp4, gif and html, ``fps``,
            ``width``, ``height`` and ``progress`` for mp4 and gif, ``title`` for html. None means not given.

    Returns:
        The path.

    Raises:
        InputError: unknown extension, a place that cannot be written, or an existing file and not `force`.
    """
    writer = _function(path, WRITERS, "written")
    return writer(motion, path, force=force, **_known(writer, path, options))


def _known(function: Any, path: str | os.PathLike, options: dict[str, Any]) -> dict[str, Any]:
    """The options that are given, all of which the format must know."""
    options = {name: value for name, value in options.items() if value is not None}
    names = [name for name, option in signature(function).parameters.items() if option.default is not Parameter.empty]
    for name in options:
        if name not in names or name == "force":
            raise InputError(path, name, f"no option of this format; it has {', '.join(names)}")
    return options


def _function(path: str | os.PathLike, table: dict[str, str], done: str) -> Any:
    extension = Path(path).suffix.lower()
    if extension not in table:
        raise InputError(path, extension or "no extension", f"only {' '.join(table)} can be {done}")
    module, name = table[extension].split(".")
    return getattr(import_module(f"motionary.formats.{module}"), name)
