"""A preprocessed corpus on disk: one memory-mapped array of frames, two Parquet tables, one context."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from motionary.corpus.context import Context
from motionary.corpus.splits import SPLITS
from motionary.errors import InputError
from motionary.motion import Motion

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

    def __len__(self) -> int:
        return len(self.clip)


class Corpus:
    """A folder that preprocess wrote, opened read-only.

    Args:
        folder: where `preprocess` put it.

    Attributes:
        context: skeleton, fps, codec, statistics, vocabulary.
        frames: (F, D) float32 memory map of RAW features, all windows one after the other.
        clips, captions: the tables as numpy columns.
        caption_start: (clips + 1,) captions of clip i are rows caption_start[i] to caption_start[i + 1].
    """

    def __init__(self, folder: str | Path):
        self.folder = Path(folder)
        missing = [
            name for name in ("context.json", "frames.npy", "clips.parquet") if not (self.folder / name).is_file()
        ]
        if missing:
            raise InputError(folder, ", ".join(missing), "missing; run the preprocess stage first")
        self.context = Context.load(self.folder / "context.json")
        # A plain array view of the map: fancy indexing then returns ordinary arrays.
        self.frames = np.load(self.folder / "frames.npy", mmap_mode="r").view(np.ndarray)
        self.clips = Clips(**_columns(self.folder / "clips.parquet", Clips))
        self.captions = Captions(**_columns(self.folder / "captions.parquet", Captions))
        self.caption_start = np.searchsorted(self.captions.clip, np.arange(len(self.clips) + 1))

    @classmethod
    def open(cls, folder: str | Path) -> Corpus:
        """Open a preprocessed corpus; InputError where the folder is not one."""
        return cls(folder)

    def __len__(self) -> int:
        return len(self.clips)

    @cached_property
    def hash(self) -> str:
        """Content hash (hex) of frames and tables, computed when the corpus was written."""
        return json.loads((self.folder / "report.json").read_text(encoding="utf-8"))["hash"]

    def features(self, i: int) -> np.ndarray:
        """(T, D) read-only view of the raw features of window i."""
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
    def style_ids(self) -> np.ndarray:
        """(clips,) position of each window's style in `context.styles`, -1 where unknown."""
        return _label_ids(self.clips.style, self.context.styles)

    @cached_property
    def action_ids(self) -> np.ndarray:
        """(clips,) position of each window's action in `context.actions`, -1 where unknown."""
        return _label_ids(self.clips.action, self.context.actions)


def _columns(path: Path, kind: type) -> dict[str, np.ndarray]:
    table = pq.read_table(path)
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
