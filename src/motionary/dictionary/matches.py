"""What a search of the corpus finds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from motionary.motion import Motion


@dataclass(frozen=True)
class Match:
    """A window of the corpus that a search found.

    Attributes:
        id: of the window.
        origin, start, end: the clip it was cut from, and its seconds there.
        captions: as written.
        distance: to the text, in the evaluator's space.
        motion: the window itself; None where the corpus came without motions, as a bundle's does.
    """

    id: str
    origin: str
    start: float
    end: float
    captions: tuple[str, ...]
    distance: float
    motion: Motion | None

    @classmethod
    def of(cls, corpus: Any, row: int, distance: float) -> Match:
        """Row `row` of an opened corpus, found at `distance`."""
        clips = corpus.clips
        captions = tuple(str(corpus.captions.text[c]) for c in corpus.captions_of(row))
        start, end = float(clips.start[row]), float(clips.end[row])
        motion = corpus.motion(row) if corpus.has_motions else None
        return cls(str(clips.id[row]), str(clips.origin[row]), start, end, captions, distance, motion)
