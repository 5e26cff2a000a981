"""The results of reading an archive: captions, flags, near-duplicates, and the index that is searched."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from motionary.archive.duplicates import Pair, near_duplicates
from motionary.archive.flags import Told, flags
from motionary.archive.parts import ArchivePart, ClipRow
from motionary.corpus.clips import Clip, inside
from motionary.errors import InputError
from motionary.files import atomic_folder, save_array, write_bytes

HIDDEN, INDEX = ".motionary", "index"
CAPTIONS, FLAGS, DUPLICATES = "captions.jsonl", "flags.jsonl", "duplicates.jsonl"
Read = tuple[Clip, ClipRow, ArchivePart, int]


def write_out(
    folder: Path, out: Path, read: Sequence[Read], version: Mapping[str, str], progress: bool
) -> dict[str, Any]:
    """Write what was read of a folder into `out`; returns the counts."""
    rows = [row for _, row, _, _ in read]
    suspected = flags([_told(clip, row) for clip, row, _, _ in read])
    windows = [(c, *window) for c, row in enumerate(rows) for window in row.windows]
    embeddings, outlines = _stacked(read, "embeddings"), _stacked(read, "outlines")
    owner = np.array([window[0] for window in windows], np.int64)
    seconds = np.array([window[2] - window[1] for window in windows])
    # What never moves is near everything that never moves either.
    moving = np.array([not {"idle", "t-pose"} & set(suspected[c]) for c in owner], bool)
    pairs = _renumbered(
        near_duplicates(outlines[moving], embeddings[moving], owner[moving], seconds[moving], progress), moving
    )
    hours = sum(row.seconds for row in rows) / 3600
    counts = {
        "clips": len(rows),
        "windows": len(windows),
        "hours": round(hours, 3),
        "flagged": dict(sorted(Counter(flag for own in suspected for flag in own).items())),
        "broken": sum(map(bool, suspected)),
        "duplicates": len(pairs),
    }
    there = os.path.relpath(folder.resolve(), out.resolve())  # so that both may be moved together
    _write_index(out / HIDDEN / INDEX, rows, suspected, windows, embeddings, {**version, **counts, "folder": there})
    _write_lines(out / CAPTIONS, _captions(folder, read, suspected, version["captioner"]))
    broken = [(row.file, own) for row, own in zip(rows, suspected, strict=True) if own]
    _write_lines(out / FLAGS, ({"motion": file, "flags": own} for file, own in broken))
    _write_lines(out / DUPLICATES, (_pair(pair, rows, windows) for pair in pairs))
    return counts


def _told(clip: Clip, row: ClipRow) -> Told:
    said = (clip.action, *(caption.text for caption in clip.captions))
    return Told(Path(row.file).suffix.lower(), row.up, row.unit, said, row.problem, row.measures)


def _stacked(read: Sequence[Read], name: str) -> np.ndarray:
    arrays = [getattr(part, name)[first : first + len(row.windows)] for _, row, part, first in read if row.windows]
    return np.concatenate(arrays) if arrays else np.zeros((0, 0), np.float32)


def _renumbered(pairs: Sequence[Pair], kept: np.ndarray) -> list[Pair]:
    """Pairs of rows among those kept, as pairs of rows among all."""
    rows = np.flatnonzero(kept)
    return [Pair(int(rows[p.first]), int(rows[p.second]), p.joints, p.embedding) for p in pairs]


def _write_index(
    place: Path,
    rows: Sequence[ClipRow],
    suspected: Sequence[Mapping[str, str]],
    windows: Sequence[tuple[int, float, float, str]],
    embeddings: np.ndarray,
    told: Mapping[str, Any],
) -> None:
    """`clips.parquet`, `windows.parquet`, `embeddings.npy` and `index.json`, as one folder."""
    clips = [
        {name: value for name, value in asdict(row).items() if name not in ("key", "windows")}
        | {"measures": json.dumps(row.measures), "flags": json.dumps(own)}
        for row, own in zip(rows, suspected, strict=True)
    ]
    names = ("clip", "start", "end", "caption")
    with atomic_folder(place) as temporary:
        pq.write_table(pa.Table.from_pylist(clips), temporary / "clips.parquet")
        table = {name: [window[i] for window in windows] for i, name in enumerate(names)}
        kinds = (pa.int64(), pa.float64(), pa.float64(), pa.string())
        schema = pa.schema(list(zip(names, kinds, strict=True)))
        pq.write_table(pa.Table.from_pydict(table, schema), temporary / "windows.parquet")
        save_array(temporary / "embeddings.npy", embeddings)
        (temporary / "index.json").write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")


def _captions(
    folder: Path, read: Sequence[Read], suspected: Sequence[Mapping[str, str]], captioner: str
) -> Iterator[dict[str, Any]]:
    """A line of `clips.jsonl` for each sound clip: what its listing says, and the captions that were made."""
    listed = _listed(folder)
    for (clip, row, _, _), broken in zip(read, suspected, strict=True):
        if broken:
            continue
        line = listed.get(row.file) or _line(clip, row)
        made = [
            {"text": text, "start": round(start, 3), "end": round(end, 3), "source": captioner}
            for start, end, text in _apart(row.windows)
            if text
        ]
        given = line.get("captions")
        yield {**line, "captions": [*(given if isinstance(given, list) else []), *made]}


def _line(clip: Clip, row: ClipRow) -> dict[str, Any]:
    """What is known of a clip that no `clips.jsonl` lists."""
    labels = {name: getattr(clip, name) for name in ("subject", "style", "action") if getattr(clip, name)}
    rate = {} if clip.fps is None else {"fps": clip.fps}
    said = [{k: v for k, v in asdict(c).items() if k != "tokens" and v not in (None, "")} for c in clip.captions]
    return {"motion": row.file, **rate, **labels, "captions": said}


def _listed(folder: Path) -> dict[str, dict[str, Any]]:
    """The lines of a folder's `clips.jsonl` by motion, however they spell its path; what cannot be read was said when
    the clips were listed."""
    found: dict[str, dict[str, Any]] = {}
    if not (path := folder / "clips.jsonl").is_file():
        return found
    for line in path.read_text(encoding="utf-8-sig", errors="replace").splitlines():
        try:
            values = json.loads(line)
            found.setdefault(str(inside(folder, values, "clips.jsonl")), values)
        except (InputError, ValueError, AttributeError, RecursionError):
            continue
    return found


def _apart(windows: Sequence[tuple[float, float, str]]) -> Sequence[tuple[float, float, str]]:
    """Windows that overlap little: where neighbours overlap by half, every second one, and always the last."""
    last = [windows[-1]] if windows and len(windows) % 2 == 0 else []
    return [*windows[::2], *last]


def _pair(pair: Pair, rows: Sequence[ClipRow], windows: Sequence[tuple[int, float, float, str]]) -> dict[str, Any]:
    ends = [
        {"motion": rows[windows[w][0]].file, "start": round(windows[w][1], 3), "end": round(windows[w][2], 3)}
        for w in (pair.first, pair.second)
    ]
    return {"motions": ends, "joints_m": round(pair.joints, 4), "embedding": round(pair.embedding, 4)}


def _write_lines(path: Path, lines: Iterator[dict[str, Any]]) -> None:
    write_bytes(path, "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in lines))
