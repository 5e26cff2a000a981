"""A long take read: how fast, and how much memory it takes beyond what the process held."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from motionary.bench.measure import peak_memory
from motionary.bench.shapes import Shapes
from motionary.bench.workload import Work

_JOINTS = 73
_POSES = 100  # different ones


def long_bvh(shapes: Shapes) -> Work:
    """A BVH of 73 joints, 120 frames a second, each number of seven or eight characters, as suits write them."""
    from motionary.formats import read_motion

    folder = tempfile.TemporaryDirectory()
    path = Path(folder.name) / "take.bvh"
    known = {"up": "y", "unit": "cm", "mirror": False}
    _write(path, 2)
    read_motion(path, **known)  # what reading a file loads is no part of the file
    _write(path, shapes.take_frames)
    size, before = path.stat().st_size, peak_memory()

    def note(seconds: float) -> str:
        """Speed and memory, in terms of the file."""
        more = (peak_memory() - before) / size
        return (
            f"{size / 1e6 / seconds:.1f} MB/s of a file of {size / 1e6:.0f} MB; at its peak {more:.2f} times the file"
        )

    return Work(lambda: (folder.name, read_motion(path, **known)), note)


def _write(path: Path, frames: int) -> None:
    root = "ROOT j0 { OFFSET 0 0 0 CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n"
    inner = "".join(f"JOINT j{j} {{ OFFSET 0 2 0 CHANNELS 3 Zrotation Xrotation Yrotation\n" for j in range(1, _JOINTS))
    angles = np.random.default_rng(0).uniform(-50, 50, (_POSES, 3 * _JOINTS + 3))
    rows = [" ".join(f"{angle:.4f}" for angle in row) + "\n" for row in angles]
    with path.open("w", encoding="utf-8") as file:
        file.write(f"HIERARCHY\n{root}{inner}{'}' * _JOINTS}\nMOTION\nFrames: {frames}\nFrame Time: 0.0083333\n")
        for frame in range(frames):
            file.write(rows[frame % _POSES])
