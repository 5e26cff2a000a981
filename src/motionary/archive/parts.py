"""What one process makes of a few clips of an archive, kept in a file so that nothing is done twice."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from motionary.archive.clip_measures import measured
from motionary.archive.moments import INSTANTS, Cut, cuts
from motionary.corpus.checks import unforeseen
from motionary.corpus.clips import Clip
from motionary.dictionary import Dictionary, load
from motionary.errors import InputError
from motionary.files import atomic_file
from motionary.systems.registry import EMBED, MOTION_TO_TEXT

SUFFIX = ".part"


@dataclass
class ClipRow:
    """What was found out of one clip.

    Attributes:
        key: of the file as it was, and of how it was read.
        file: relative to the archive.
        problem: why nothing could be made of it, "" where it could.
        measures: see `clip_measures.measured`.
        windows: (start, end) seconds and caption of each.
    """

    key: str
    file: str
    seconds: float = 0.0
    fps: float = 0.0
    problem: str = ""
    up: str = "y"
    unit: float = 1.0
    measures: dict[str, float] = field(default_factory=dict)
    windows: list[tuple[float, float, str]] = field(default_factory=list)


@dataclass
class ArchivePart:
    """A few clips, and of all their windows in order: embeddings (W, E) float32 and outlines (W, 16, J, 3) float16."""

    clips: list[ClipRow]
    embeddings: np.ndarray
    outlines: np.ndarray

    def save(self, path: Path) -> None:
        """Written whole or not at all."""
        told = json.dumps([asdict(clip) for clip in self.clips])
        with atomic_file(path) as temporary, temporary.open("wb") as file:
            np.savez(file, clips=np.array(told), embeddings=self.embeddings, outlines=self.outlines)

    @staticmethod
    def load(path: Path) -> ArchivePart:
        """What `save` wrote."""
        with np.load(path, allow_pickle=False) as arrays:
            clips = [ClipRow(**row) for row in json.loads(str(arrays["clips"]))]
            return ArchivePart(clips, arrays["embeddings"], arrays["outlines"])


@dataclass(frozen=True)
class Readers:
    """Which models read an archive: the folder, the device, the system that captions and the one that embeds."""

    models: str
    device: str
    captioner: str
    judge: str


@lru_cache(maxsize=1)
def _opened(readers: Readers) -> Dictionary:
    return load(readers.models, readers.device)


def make_part(clips: Sequence[tuple[Clip, str, str]], readers: Readers, path: str) -> int:
    """Read, measure, caption and embed clips, each with its file's name and key; writes the part and counts them.

    What cannot be read is a problem of its row; nothing of a clip's own raises.
    """
    rows, found = [], []
    for clip, file, key in clips:
        row, windows = _read(clip, ClipRow(key, file), readers)
        rows.append(row)
        found.append(windows)
    features = [cut.features for windows in found for cut in windows]
    captions, embeddings = _answered(features, readers)
    said = iter(captions)
    for row, windows in zip(rows, found, strict=True):
        row.windows = [(cut.start, cut.end, next(said)) for cut in windows]
    joints = len(_opened(readers).context(readers.judge).skeleton)
    outlines = np.array([cut.outline for windows in found for cut in windows], np.float16)
    ArchivePart(rows, embeddings, outlines.reshape(-1, INSTANTS, joints, 3)).save(Path(path))
    return len(rows)


def _answered(features: list[np.ndarray], readers: Readers) -> tuple[list[str], np.ndarray]:
    """A caption and an embedding (N, E) of each window."""
    dictionary = _opened(readers)
    judge = dictionary.opened(EMBED, readers.judge)
    if not features:
        return [], np.zeros((0, 0), np.float32)
    captions = dictionary.opened(MOTION_TO_TEXT, readers.captioner).caption(features, beams=1, quick=True)
    return [texts[0] if texts else "" for texts in captions], judge.motions(features)


def _read(clip: Clip, row: ClipRow, readers: Readers) -> tuple[ClipRow, list[Cut]]:
    """A clip's row and windows, none where it cannot be read."""
    try:
        motion, clip = clip.load(clip)
        row.seconds, row.fps = motion.duration, motion.fps
        if clip.reading is not None:
            row.up, row.unit = clip.reading.up, clip.reading.unit
        row.measures = measured(motion)
        return row, cuts(motion, _opened(readers).context(readers.judge))
    except InputError as problem:
        row.problem = str(problem)
    except Exception as error:  # one clip that nobody foresaw must not end a run of hours
        row.problem = str(unforeseen(clip.where, error))
    return row, []


def stored(folder: Path) -> list[tuple[Path, ArchivePart]]:
    """The parts of a folder, each with its file; one that cannot be read (a disk that failed) is made anew."""
    found = []
    for path in sorted(folder.glob(f"[!.]*{SUFFIX}")):
        try:
            found.append((path, ArchivePart.load(path)))
        except Exception:
            path.unlink(missing_ok=True)
    return found
