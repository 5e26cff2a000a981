"""The files of an index as they are read again: checked, since a disk, a program or a person may have changed them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from motionary.errors import InputError
from motionary.systems.registry import EMBED, offering

HIDDEN, INDEX = ".motionary", "index"
TOLD, CLIPS, WINDOWS, EMBEDDINGS = "index.json", "clips.parquet", "windows.parquet", "embeddings.npy"
WINDOW_COLUMNS = {"clip": pa.int64(), "start": pa.float64(), "end": pa.float64(), "caption": pa.string()}
AGAIN = "missing or damaged; run `motionary index` again"
_LONGEST = 1 << 20  # bytes of an index.json, of which a kilobyte is usual


def read_told(place: Path) -> dict[str, Any]:
    """What `index.json` says; the keys that every version wrote are there.

    Raises:
        InputError: missing or damaged.
    """
    with _intact(place / TOLD) as path:
        if path.stat().st_size > _LONGEST:
            raise ValueError("too long")
        told = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(told, dict):
            raise ValueError("no object")
        for key in ("folder", "judge", "judge_hash"):
            if not isinstance(told.get(key), str):
                raise ValueError(f"{key} must be text")
        return told


def check_judge(place: Path, told: Mapping[str, Any]) -> None:
    """InputError unless the judge that an index names is a system that embeds: its name becomes a part of a path."""
    if told["judge"] not in (known := offering(EMBED)):
        rule = f"must be among {', '.join(known)}; run `motionary index` again"
        raise InputError(f"{place / TOLD}: judge", told["judge"], rule)


def read_clips(place: Path) -> tuple[dict[str, list[Any]], list[dict[str, str]]]:
    """The clips' files, as columns, and the flags of each.

    Raises:
        InputError: missing or damaged.
    """
    with _intact(place / CLIPS) as path:
        # Each clip has a name of its own, which takes a byte or more, however well the names are packed.
        table = _table(path, {"file": pa.string(), "flags": pa.string()}, range(path.stat().st_size)).to_pydict()
        flags = [json.loads(own) for own in table["flags"]]
        if not all(isinstance(own, dict) and all(isinstance(why, str) for why in own.values()) for own in flags):
            raise ValueError("flags must be objects of texts")
        return table, flags


def read_embeddings(place: Path) -> np.ndarray:
    """(W, E) embeddings, which stay on the disk; whether they are finite is seen when they are compared.

    Raises:
        InputError: missing or damaged.
    """
    with _intact(place / EMBEDDINGS) as path:
        found = np.load(path, mmap_mode="r")
        if not isinstance(found, np.ndarray) or found.ndim != 2 or found.dtype.kind != "f":
            raise ValueError("must be a table of real numbers")
        if len(found) and not found.shape[1]:
            raise ValueError("no columns")
        return found


def read_windows(place: Path, count: int, clips: int) -> dict[str, list[Any]]:
    """Clip, seconds and caption of `count` windows, as columns.

    Raises:
        InputError: missing or damaged, or not those of so many embeddings and clips.
    """
    with _intact(place / WINDOWS) as path:
        table = _table(path, WINDOW_COLUMNS, range(count, count + 1))
        clip, start, end = (table[name].to_numpy() for name in ("clip", "start", "end"))
        if not ((clip >= 0) & (clip < clips)).all():
            raise ValueError(f"clips must be from 0 to {clips - 1}")
        if not (np.isfinite(end) & (start >= 0) & (start <= end)).all():
            raise ValueError("seconds must be from 0 up, and start before end")
        return table.to_pydict()


@contextmanager
def _intact(path: Path) -> Iterator[Path]:
    """The path, of which whatever the block raises is an InputError that names it."""
    try:
        if not path.is_file():  # a pipe would be waited for
            raise FileNotFoundError("no such file")
        yield path
    except Exception as error:
        raise InputError(path, error, AGAIN) from None


def _table(path: Path, kinds: Mapping[str, pa.DataType], rows: range) -> pa.Table:
    """Columns of these names and types, without gaps; how many rows there are is asked before any is unpacked, since
    equal rows take no room in the file, but in memory."""
    with pq.ParquetFile(path) as file:
        if (count := file.metadata.num_rows) not in rows:
            raise ValueError(f"{count:,} rows, of which there must be {rows[0] if len(rows) == 1 else 'fewer'}")
        for name, kind in kinds.items():
            if file.schema_arrow.get_field_index(name) < 0 or file.schema_arrow.field(name).type != kind:
                raise ValueError(f"column {name} must be there, of type {kind}")
        table = file.read(columns=list(kinds))
    if any(column.null_count for column in table.columns):
        raise ValueError("columns must have no gaps")
    return table
