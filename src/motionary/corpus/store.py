"""A preprocessed corpus on disk: one memory-mapped array of frames, two Parquet tables, one context."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from motionary.corpus.context import Context
from motionary.corpus.splits import SPLITS
from motionary.errors import InputError
from motionary.files import written_by
from motionary.motion import Motion

MIRROR = "@mirror"  # ends the id of a mirrored copy that preprocess added
CLIP_SCHEMA = pa.schema(
    [
        ("id", pa.string()),
        ("offset", pa.int64()),
        ("length", pa.int64()),
        ("split", pa.string()),
        ("subject", pa.string()),
        ("style", pa.string()),
        ("action", pa.string()),
        ("mirrored", pa.bool_()),
        ("origin", pa.string()),
        ("start", pa.float64()),
        ("end", pa.float64()),
        ("group", pa.string()),
        ("attributes", pa.string()),
    ]
)
CAPTION_SCHEMA = pa.schema(
    [
        ("clip", pa.int64()),
        ("text", pa.string()),
        ("words", pa.list_(pa.string())),
        ("tags", pa.list_(pa.string())),
        ("key", pa.int64()),
        ("source", pa.string()),
        ("human", pa.bool_()),
        ("weight", pa.float32()),
    ]
)


@dataclass(frozen=True, eq=False)
class Clips:
    """One row per window. `offset` and `length` count feature frames; `start` and `end` are seconds of the source
    clip `origin`; `group` names the root it came from; unknown subject, style and action are "". `attributes` is what
    the demo grammar knows to be true of the motion, as JSON; "" elsewhere and for mirrored copies."""

    id: np.ndarray
    offset: np.ndarray
    length: np.ndarray
    split: np.ndarray
    subject: np.ndarray
    style: np.ndarray
    action: np.ndarray
    mirrored: np.ndarray
    origin: np.ndarray
    start: np.ndarray
    end: np.ndarray
    group: np.ndarray
    attributes: np.ndarray

    def __len__(self) -> int:
        return len(self.id)


@dataclass(frozen=True, eq=False)
class Captions:
    """One row per caption, in the order of the clips. `clip` is the row of its window, `words` and `tags` are tuples
    of the normalized sentence, `key` numbers the distinct normalized texts, `human` is False for templates."""

    clip: np.ndarray
    text: np.ndarray
    words: np.ndarray
    tags: np.ndarray
    key: np.ndarray
    source: np.ndarray
    human: np.ndarray
    weight: np.ndarray

    def __len__(self) -> int:
        return len(self.clip)


class Corpus:
    """A folder that preprocess wrote, opened read-only.

    Args:
        folder: where `preprocess` put it.
        motions: False opens the tables alone, as a bundle ships them: without frames no window has features.

    Attributes:
        context: skeleton, fps, codec, statistics, vocabulary.
        frames: (F, D) float32 memory map of RAW features, all windows one after the other; (0, D) without motions.
        clips, captions: the tables as numpy columns.
        caption_start: (clips + 1,) captions of clip i are rows caption_start[i] to caption_start[i + 1].
    """

    def __init__(self, folder: str | Path, motions: bool = True):
        self.folder = Path(folder)
        needed = ("context.json", *(["frames.npy"] * motions), "clips.parquet")
        missing = [name for name in needed if not (self.folder / name).is_file()]
        if missing:
            raise InputError(folder, ", ".join(missing), "missing; run the preprocess stage first")
        with self._reading("context.json") as path:
            self.context = Context.load(path)
        self.frames = self._frames() if motions else np.empty((0, self.context.dim), np.float32)
        with self._reading("clips.parquet") as path:
            self.clips = Clips(**_columns(path, Clips))
            inside = (self.clips.offset >= 0) & (self.clips.offset + self.clips.length <= len(self.frames))
            _check("offset + length", len(self.frames), bool(inside.all()), "must end within frames.npy")
        with self._reading("captions.parquet") as path:
            self.captions = Captions(**_columns(path, Captions))
            rows = self.captions.clip
            sorts = not len(rows) or (rows[0] >= 0 and rows[-1] < len(self.clips) and bool((np.diff(rows) >= 0).all()))
            _check("clip", len(self.clips), sorts, "must be rows of clips.parquet, in their order")
        self.caption_start = np.searchsorted(self.captions.clip, np.arange(len(self.clips) + 1))

    @classmethod
    def open(cls, folder: str | Path, motions: bool = True) -> Corpus:
        """Open a preprocessed corpus; InputError where the folder is not one."""
        return cls(folder, motions)

    def _frames(self) -> np.ndarray:
        with self._reading("frames.npy") as path:
            # A plain array view of the map: fancy indexing then returns ordinary arrays.
            frames = np.load(path, mmap_mode="r").view(np.ndarray)
            _check("shape", frames.shape, frames.shape[1:] == (self.context.dim,), "must be (frames, features)")
            return frames

    def __len__(self) -> int:
        return len(self.clips)

    @property
    def has_motions(self) -> bool:
        """Whether windows have features, and not their tables alone."""
        return len(self.frames) > 0

    @cached_property
    def report(self) -> dict[str, Any]:
        """What `preprocess` reported of it: see :func:`motionary.corpus.preprocess.preprocess`."""
        with self._reading("report.json") as path:
            return dict(json.loads(path.read_text(encoding="utf-8")))

    @property
    def hash(self) -> str:
        """Content hash (hex) of frames and tables, computed when the corpus was written."""
        return self.report["hash"]

    @contextmanager
    def _reading(self, name: str) -> Iterator[Path]:
        """The path of a file of the folder; what is wrong with it is told with it and the stage that wrote it."""
        path = self.folder / name
        with written_by("preprocess", path):
            yield path

    def features(self, i: int) -> np.ndarray:
        """(T, D) read-only view of the raw features of window i; InputError where the corpus came without motions."""
        _check("corpus", self.folder, self.has_motions, "holds texts alone, no motion")
        start = self.clips.offset[i]
        return self.frames[start : start + self.clips.length[i]]

    def motion(self, i: int) -> Motion:
        """Window i decoded to joint positions."""
        return self.context.make_codec().decode(self.features(i), fps=self.context.fps)

    def captions_of(self, i: int) -> range:
        """Caption rows of window i."""
        return range(self.caption_start[i], self.caption_start[i + 1])

    def rows(self, split: str | None = None, captioned: bool | None = None, group: str | None = None) -> np.ndarray:
        """Window rows (int64) of a split ("train", "val", "test" or None for all), with or without captions."""
        if split is not None and split not in SPLITS:
            raise InputError("split", split, f"must be one of {', '.join(SPLITS)}")
        keep = np.ones(len(self.clips), dtype=bool) if split is None else self.clips.split == split
        if captioned is not None:
            keep &= (np.diff(self.caption_start) > 0) == captioned
        if group is not None:
            keep &= self.clips.group == group
        return np.flatnonzero(keep)

    @cached_property
    def added(self) -> np.ndarray:
        """(clips,) bool: the mirrored copies that preprocess added to training; those of a release are its own clips,
        which count wherever clips do."""
        return np.array([str(name).endswith(MIRROR) for name in self.clips.id], dtype=bool)

    @cached_property
    def style_ids(self) -> np.ndarray:
        """(clips,) position of each window's style in `context.styles`, -1 where unknown."""
        return _label_ids(self.clips.style, self.context.styles)

    @cached_property
    def action_ids(self) -> np.ndarray:
        """(clips,) position of each window's action in `context.actions`, -1 where unknown."""
        return _label_ids(self.clips.action, self.context.actions)


def _check(what: str, value: Any, holds: bool, rule: str) -> None:
    if not holds:
        raise InputError(what, value, rule)


def _columns(path: Path, kind: type) -> dict[str, np.ndarray]:
    table = pq.read_table(path, page_checksum_verification=True)
    columns = {}
    for field in fields(kind):
        column = table[field.name]
        if pa.types.is_list(column.type):
            values = np.empty(len(column), dtype=object)
            values[:] = [tuple(row) for row in column.to_pylist()]
            columns[field.name] = values
        else:
            columns[field.name] = column.to_numpy()
    return columns


def _label_ids(values: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    position = {name: i for i, name in enumerate(names)}
    return np.array([position.get(value, -1) for value in values], dtype=np.int64)
