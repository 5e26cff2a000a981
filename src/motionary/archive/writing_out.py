"""The results of reading an archive: captions, flags, near-duplicates, and the index that is searched."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from hashlib import sha256
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from motionary.archive.duplicates import Pair, near_duplicates
from motionary.archive.flags import Told, flags
from motionary.archive.parts import ArchivePart, ClipRow
from motionary.archive.stored_index import CLIPS, EMBEDDINGS, HIDDEN, INDEX, TOLD, WINDOW_COLUMNS, WINDOWS
from motionary.archive.written_results import CAPTIONS, DUPLICATES, FLAGS, WROTE, claim
from motionary.corpus.clips import Clip, captions, inside, read_listing
from motionary.files import atomic_folder, save_array, write_bytes

Read = tuple[Clip, ClipRow, ArchivePart, int]


def write_out(
    folder: Path, out: Path, read: Sequence[Read], version: Mapping[str, str], progress: bool, force: bool
) -> dict[str, Any]:
    """Write what was read of a folder into `out`; returns the counts. InputError as of `claim`."""
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
    broken = [(row.file, own) for row, own in zip(rows, suspected, strict=True) if own]
    results = {
        CAPTIONS: _lines(_captions(folder, read, suspected, version["captioner"])),
        FLAGS: _lines({"motion": file, "flags": own} for file, own in broken),
        DUPLICATES: _lines(_pair(pair, rows, windows) for pair in pairs),
    }
    own = claim(out, force)  # again: reading may have taken hours
    # The index comes first: a run that is killed after it leaves results of which it knows the hashes, old or new.
    wrote = {name: sorted({sha256(data).hexdigest(), own.get(name, "")} - {""}) for name, data in results.items()}
    told = {**version, **counts, "folder": there, WROTE: wrote}
    _write_index(out / HIDDEN / INDEX, rows, suspected, windows, embeddings, told)
    for name, data in results.items():
        write_bytes(out / name, data)
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
    with atomic_folder(place) as temporary:
        pq.write_table(pa.Table.from_pylist(clips), temporary / CLIPS)
        table = {name: [window[i] for window in windows] for i, name in enumerate(WINDOW_COLUMNS)}
        schema = pa.schema(list(WINDOW_COLUMNS.items()))
        pq.write_table(pa.Table.from_pydict(table, schema), temporary / WINDOWS)
        save_array(temporary / EMBEDDINGS, embeddings)
        (temporary / TOLD).write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")


def _captions(
    folder: Path, read: Sequence[Read], suspected: Sequence[Mapping[str, str]], captioner: str
) -> Iterator[dict[str, Any]]:
    """A line of `clips.jsonl` for each sound clip: what its listing says, and the captions that were made."""
    listed = _listed(folder)
    for (clip, row, _, _), broken in zip(read, suspected, strict=True):
        if broken:
            continue
        values = listed.get((clip.where, row.file))
        line = _line(clip, row) if values is None else _as_read(values, clip)
        made = [
            {"text": text, "start": round(start, 3), "end": round(end, 3), "source": captioner}
            for start, end, text in _apart(row.windows)
            if text
        ]
        yield {**line, "captions": [*line["captions"], *made]}


def _line(clip: Clip, row: ClipRow) -> dict[str, Any]:
    """What is known of a clip that no `clips.jsonl` lists."""
    labels = {name: getattr(clip, name) for name in ("subject", "style", "action") if getattr(clip, name)}
    rate = {} if clip.fps is None else {"fps": clip.fps}
    said = [{k: v for k, v in asdict(c).items() if k != "tokens" and v not in (None, "")} for c in clip.captions]
    return {"motion": row.file, **rate, **labels, "captions": said}


def _listed(folder: Path) -> dict[tuple[str, str], dict[str, Any]]:
    """The lines of a folder's `clips.jsonl` by their place and motion, as the listing's own reader understands them;
    what cannot be read was said when the clips were listed."""
    if not (path := folder / "clips.jsonl").is_file():
        return {}
    lines, _ = read_listing(path, lambda values, where, _: ((where, str(inside(folder, values, where))), values))
    return dict(lines)


def _as_read(values: dict[str, Any], clip: Clip) -> dict[str, Any]:
    """What a line says of its clip, without the captions that its reader refused."""
    listed = values.get("captions") or []
    taken = (_json(entry) for entry in listed if captions({"captions": [entry]}, clip.where, []))
    return {**_json(values), "captions": list(islice(taken, len(clip.captions)))}  # its reader takes so many of a clip


def _json(values: dict[str, Any]) -> dict[str, Any]:
    """Values that JSON has a place for: Python reads NaN and Infinity too, which other readers stumble over."""
    return {key: value for key, value in values.items() if _is_json(value)}


def _is_json(value: Any) -> bool:
    try:
        json.dumps(value, allow_nan=False)
    except (ValueError, RecursionError):
        return False
    return True


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


def _lines(lines: Iterable[dict[str, Any]]) -> bytes:
    """JSON lines in UTF-8; half of a character, which has no place there, is spelled out as JSON does."""
    return "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in lines).encode("utf-8", "backslashreplace")
