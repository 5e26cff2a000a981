"""Files of a corpus as they grow: frames, and statistics that never need all of them at once."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np


class FrameWriter:
    """An .npy file of (F, D) float32 that grows by appending; its header is set right at the end."""

    def __init__(self, path: Path, dim: int):
        self.file, self.dim, self.frames = path.open("wb"), dim, 0
        self.digest = hashlib.sha256()
        self._header()

    def append(self, frames: np.ndarray) -> int:
        """Append (T, D) frames; returns the row of the first."""
        first = self.frames
        data = np.ascontiguousarray(frames, dtype="<f4").tobytes()
        self.file.write(data)
        self.digest.update(data)
        self.frames += len(frames)
        return first

    def close(self) -> str:
        """Finish the file; returns the hash (hex) of its content."""
        self.file.seek(0)
        self._header()
        self.file.close()
        return self.digest.hexdigest()

    def _header(self) -> None:
        # numpy pads the header so that the growing axis can be rewritten in place.
        header = {"descr": "<f4", "fortran_order": False, "shape": (self.frames, self.dim)}
        np.lib.format.write_array_header_1_0(self.file, header)


class RunningStatistics:
    """Mean and deviation by parallel merging of block moments (Chan, Golub and LeVeque 1979) in float64."""

    def __init__(self, dim: int):
        self.count, self.mean, self.squares = 0, np.zeros(dim), np.zeros(dim)

    def update(self, frames: np.ndarray) -> None:
        """Take in (T, D) frames."""
        frames = frames.astype(np.float64)
        mean = frames.mean(axis=0)
        delta, total = mean - self.mean, self.count + len(frames)
        self.squares += ((frames - mean) ** 2).sum(axis=0) + delta**2 * (self.count * len(frames) / total)
        self.mean = self.mean + delta * (len(frames) / total)
        self.count = total

    def deviation(self) -> np.ndarray:
        """(D,) population standard deviation of each feature."""
        return np.sqrt(self.squares / max(self.count, 1))


def group_deviation(deviation: np.ndarray, slices: Mapping[str, slice]) -> np.ndarray:
    """(D,) float32: the deviation averaged within each feature group; root and contacts then divided by 5.

    This is what HumanML3D releases and its papers call "scaled by 5": dividing by a smaller deviation makes the few
    root and contact features count more. A group that never varies gets 1.
    """
    result = np.empty(len(deviation), dtype=np.float64)
    for name, part in slices.items():
        value = float(deviation[part].mean())
        if value < 1e-6:
            value = 1.0
        elif name.startswith("root_") or name == "contacts":
            value /= 5
        result[part] = value
    return result.astype(np.float32)
