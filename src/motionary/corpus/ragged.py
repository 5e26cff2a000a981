"""Rows of different lengths on disk, one after the other in a memory map."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from motionary.corpus.datasets import gather
from motionary.files import LISTED, atomic_folder, file_hash, list_files, read_list, save_array, written_by


class Ragged:
    """A list of arrays (N_i, ...) that share all but their first dimension.

    Args:
        values: (sum of N_i, ...) all rows one after the other.
        offsets: (rows + 1,) where each row starts.
    """

    def __init__(self, values: np.ndarray, offsets: np.ndarray):
        self.values, self.offsets = values, offsets
        self.lengths = np.diff(offsets)

    @classmethod
    def collect(cls, rows: Iterable[np.ndarray]) -> Ragged:
        """In memory."""
        arrays = list(rows)
        return cls(np.concatenate(arrays), np.concatenate([[0], np.cumsum([len(a) for a in arrays])]).astype(np.int64))

    @classmethod
    def cached(cls, folder: Path, rows: Callable[[], Iterable[np.ndarray]]) -> Ragged:
        """Of the folder, a memory map; where it is not there, or a disk has damaged it, which a line says, `rows` are
        made and written first, one at a time."""
        if not folder.is_dir() or _damaged(folder):
            with atomic_folder(folder) as fresh:
                _write(fresh, rows())
                list_files(fresh)
        with written_by("code", folder / "shape.json"):
            found = json.loads((folder / "shape.json").read_text(encoding="utf-8"))
            offsets = np.load(folder / "offsets.npy")
            shape = (int(offsets[-1]), *found["tail"])
            # A plain array view of the map: fancy indexing then returns ordinary arrays.
            values = np.memmap(folder / "values.bin", found["kind"], "r", shape=shape).view(np.ndarray)
        return cls(values, offsets)

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def __getitem__(self, i: int) -> np.ndarray:
        return self.values[self.offsets[i] : self.offsets[i + 1]]

    def padded(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(B, N, ...) these rows, zero beyond their lengths (B,)."""
        count = self.lengths[rows]
        return gather(self.values, self.offsets[rows], count, int(count.max())), count


def _damaged(folder: Path) -> bool:
    """Whether a file is not what was written; says so."""
    bad = _first_damaged(folder)
    if bad:
        print(f"warning: {folder / bad}: damaged; it is made anew", file=sys.stderr, flush=True)
    return bool(bad)


def _first_damaged(folder: Path) -> str:
    """Name of a file that is not as the folder's list says, or of the list; "" where all are."""
    try:
        return next((name for name, (_, told) in read_list(folder).items() if file_hash(folder / name) != told), "")
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return LISTED


def _write(folder: Path, rows: Iterable[np.ndarray]) -> None:
    """values.bin, offsets.npy and shape.json."""
    ends, tail, kind = [0], (), "float32"
    with (folder / "values.bin").open("wb") as file:
        for row in rows:
            ends.append(ends[-1] + len(row))
            tail, kind = row.shape[1:], row.dtype.name
            file.write(np.ascontiguousarray(row).tobytes())
    save_array(folder / "offsets.npy", np.array(ends, dtype=np.int64))
    (folder / "shape.json").write_text(json.dumps({"tail": tail, "kind": kind}), encoding="utf-8")
