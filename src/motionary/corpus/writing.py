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


def group_means(deviation: np.ndarray, slices: Mapping[str, slice]) -> np.ndarray:
    """(D,) float32: the deviation averaged within each feature group, as in HumanML3D's released Std.npy.

    A group that never varies gets 1.
    """
    result = np.empty(len(deviation), dtype=np.float64)
    for part in slices.values():
        value = float(deviation[part].mean())
        result[part] = value if value >= 1e-6 else 1.0
    return result.astype(np.float32)


def group_deviation(deviation: np.ndarray, slices: Mapping[str, slice]) -> np.ndarray:
    """(D,) float32: :func:`group_means`, those of root and contacts divided by 5 where they vary.

    The released training code does this when it starts, and its papers call it "scaled by 5": dividing by a smaller
    deviation makes the few root and contact features count more.
    """
    result = group_means(deviation, slices).astype(np.float64)
    for name, part in slices.items():
        if (name.startswith("root_") or name == "contacts") and deviation[part].mean() >= 1e-6:
            result[part] /= 5
    return result.astype(np.float32)
