"""Motion files: one reader and one writer per extension, loaded only when a file asks for them."""

from __future__ import annotations

import os
from importlib import import_module
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


def read_motion(path: str | os.PathLike, **options: Any) -> Motion:
    """Read a motion file by its extension: .bvh, .amc (with its .asf), .npy, .npz.

    Args:
        path: the file.
        options: for that format; ``fps`` for all, ``skeleton`` for arrays, ``unit``, ``up`` and ``skip_first`` for BVH.

    Returns:
        The motion in metres, y up.

    Raises:
        InputError: unknown extension, or a file that breaks a rule: file, value and rule in one line.
    """
    return _function(path, READERS, "read")(path, **options)


def write_motion(motion: Motion, path: str | os.PathLike, force: bool = True, **options: Any) -> Path:
    """Write a motion by the path's extension: .bvh .npy .npz .glb .mp4 .gif .html. A file is whole or not there.

    Args:
        motion: what to write.
        path: where; missing folders are made.
        force: replace an existing file.
        options: for that format.

    Returns:
        The path.

    Raises:
        InputError: unknown extension, a place that cannot be written, or an existing file and not `force`.
    """
    return _function(path, WRITERS, "written")(motion, path, force=force, **options)


def _function(path: str | os.PathLike, table: dict[str, str], done: str) -> Any:
    extension = Path(path).suffix.lower()
    if extension not in table:
        raise InputError(path, extension or "no extension", f"only {' '.join(table)} can be {done}")
    module, name = table[extension].split(".")
    return getattr(import_module(f"motionary.formats.{module}"), name)
