"""An indexed folder in hand: moments that show what a text says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from motionary.archive.stored_index import (
    AGAIN,
    EMBEDDINGS,
    HIDDEN,
    INDEX,
    TOLD,
    check_judge,
    read_clips,
    read_embeddings,
    read_told,
    read_windows,
)
from motionary.dictionary import Dictionary
from motionary.errors import InputError, check_whole
from motionary.systems.io import model_hash


@dataclass(frozen=True)
class Moment:
    """A stretch of a clip that a search found.

    Attributes:
        motion: the clip's file, relative to the folder that was indexed.
        start, end: seconds in it.
        distance: to the text, in the models' space.
        caption: that was made of it.
        flags: why the clip is suspected to be broken, by flag.
        file: the clip's file as it can be opened from here.
    """

    motion: str
    start: float
    end: float
    distance: float
    caption: str
    flags: dict[str, str]
    file: str


class Archive:
    """What :func:`motionary.archive.index_folder` wrote; embeddings stay on the disk.

    Args:
        folder: the archive, or the place that the results went to.

    Raises:
        InputError: no index there, or a damaged one.

    Example:
        >>> Archive("mocap").search(motionary.load("models"), "a person jumps", k=3)  # doctest: +SKIP
    """

    def __init__(self, folder: str | Path):
        self.folder = Path(folder)
        self._place = place = self.folder / HIDDEN / INDEX
        if not self.folder.is_dir():
            raise InputError(folder, "missing", "must be a folder that `motionary index` has read")
        if not (place / TOLD).is_file():
            raise InputError(folder, "no index", f"run `motionary index {folder}` first")
        self.told: dict[str, Any] = read_told(place)
        check_judge(place, self.told)
        self.clips, self._flags = read_clips(place)
        self.embeddings = read_embeddings(place)
        self.windows = read_windows(place, len(self.embeddings), len(self))
        try:
            self._clips_folder = (self.folder.resolve() / self.told["folder"]).resolve()
        except (OSError, ValueError, RuntimeError) as error:  # a name that none can have, a circle of links
            raise InputError(f"{place / TOLD}: folder", error, AGAIN) from None

    def __len__(self) -> int:
        """Number of clips."""
        return len(self.clips["file"])

    def search(self, dictionary: Dictionary, texts: str | Sequence[str], k: int = 5, sound: bool = False) -> list[Any]:
        """The moments nearest to a text, none of which overlap; for several texts a list of k for each.

        Args:
            dictionary: with the models that the archive was indexed with.
            texts: English.
            k: moments of each text.
            sound: leave out clips that carry a flag.

        Raises:
            InputError: a text that cannot be read, k below 1, or other models than those of the index.
        """
        check_whole("k", k, 1)
        judge = self.told["judge"]
        if model_hash(dictionary.models / judge) != self.told["judge_hash"]:
            rule = f"was indexed with another {judge}; run `motionary index {self.folder}` again"
            raise InputError(self.folder, self.told["judge_hash"], rule)
        several = [texts] if isinstance(texts, str) else texts
        rows = [self._nearest(query, k, sound) for query in dictionary.embed(texts=several, system=judge)]
        return rows[0] if isinstance(texts, str) else rows

    def _nearest(self, query: np.ndarray, k: int, sound: bool) -> list[Moment]:
        away = self._distances(query)
        found: list[Moment] = []
        for row in np.argsort(away, kind="stable"):
            moment = self._moment(int(row), float(away[row]))
            if (sound and moment.flags) or any(_overlap(moment, other) for other in found):
                continue
            found.append(moment)
            if len(found) == k:
                break
        return found

    def _distances(self, query: np.ndarray) -> np.ndarray:
        """(W,) of every window to a query (E,)."""
        if not len(self.embeddings):
            return np.zeros(0)
        if self.embeddings.shape[1:] != query.shape:
            rule = f"must be {len(query)}, as the judge's are; run `motionary index` again"
            raise InputError(self._place / EMBEDDINGS, f"{self.embeddings.shape[1]} columns", rule)
        with np.errstate(over="ignore", invalid="ignore"):  # of damaged numbers, which the next line tells
            away = np.linalg.norm(np.asarray(self.embeddings) - query, axis=-1)
        if not np.isfinite(away).all():
            raise InputError(self._place / EMBEDDINGS, "numbers that are not finite", AGAIN)
        return away

    def _moment(self, row: int, distance: float) -> Moment:
        start, end, caption, clip = (self.windows[name][row] for name in ("start", "end", "caption", "clip"))
        motion, flags = self.clips["file"][clip], self._flags[clip]
        return Moment(motion, start, end, distance, caption, flags, self._file(motion))

    def _file(self, motion: str) -> str:
        """A clip's file, relative to the working folder where it lies below that."""
        path = self._clips_folder / motion
        return str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)


def _overlap(one: Moment, other: Moment) -> bool:
    return one.motion == other.motion and one.start < other.end and other.start < one.end
