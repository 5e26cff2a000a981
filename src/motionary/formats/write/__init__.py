"""Writers of motion files: one per extension, loaded only when a file asks for it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from motionary.formats.dispatch import foreseen, function_of, given
from motionary.motion import Motion

WRITERS = {
    ".bvh": "motionary.formats.write.bvh_writer:write_bvh",
    ".npy": "motionary.formats.write.array_writer:write_npy",
    ".npz": "motionary.formats.write.array_writer:write_npz",
    ".glb": "motionary.formats.write.gltf:write_glb",
    ".mp4": "motionary.formats.render.video:write_video",
    ".gif": "motionary.formats.render.video:write_video",
    ".html": "motionary.formats.render.page:write_page",
}


# Writers that keep what a character's own file holds, where it has the extension that is written.
ONTO = {
    ".bvh": "motionary.formats.write.bvh_rig:write_bvh_onto",
    ".glb": "motionary.formats.write.glb_rig:write_glb_onto",
}


def write_motion(
    motion: Motion,
    path: str | os.PathLike,
    force: bool = True,
    onto: str | os.PathLike | None = None,
    **options: Any,
) -> Path:
    """Write a motion by the path's extension: .bvh .npy .npz .glb .mp4 .gif .html. A file is whole or not there.

    Args:
        motion: what to write.
        path: where; missing folders are made.
        force: replace an existing file.
        onto: the .bvh or .glb of a character: the motion goes onto its rig (see `Motion.to`). A file of the same
            extension also keeps the rest: a BVH its nodes, offsets, channels and unit, a glb its mesh, skin and nodes.
        options: for that format: ``unit`` for BVH, ``mesh`` for glb, ``layout`` for npz, ``captions`` for mp4, gif and
            html, ``fps``, ``width``, ``height`` and ``progress`` for mp4 and gif, ``title`` for html. None: not given.

    Returns:
        The path.

    Raises:
        InputError: unknown extension, a place that cannot be written, or an existing file and not `force`.
    """
    if onto is not None:
        suffix = Path(path).suffix.lower()
        if suffix in ONTO and suffix == Path(onto).suffix.lower():
            return function_of(path, ONTO, "written")(motion, onto, path, force)
        motion = motion.to(os.fspath(onto))
    writer = function_of(path, WRITERS, "written")
    chosen = given(writer, path, options)
    with foreseen(path, f"this motion cannot be written as {Path(path).suffix}"):
        return writer(motion, path, force=force, **chosen)
