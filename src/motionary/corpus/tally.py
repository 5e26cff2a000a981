"""What became of long and short clips, and of captions by source: counted for the report."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field
from typing import Any

from motionary.corpus.windows import SHORT, Window
from motionary.corpus.workers import Encoded
from motionary.features import UNIT

PAPERS_LEAST = 2.0  # s, the shortest clip of the papers


@dataclass
class Tally:
    """Counts over the windows of all clips, mirrored copies left out.

    Attributes:
        fps: of the corpus.
    """

    fps: float
    cropped: int = 0
    rest: int = 0
    rest_frames: int = 0
    kept: Counter[str] = field(default_factory=Counter)
    dropped: Counter[str] = field(default_factory=Counter)
    captions: defaultdict[str, Counter[str]] = field(default_factory=lambda: defaultdict(Counter))

    def add(self, encoded: Encoded, split: str) -> None:
        """Counts the windows of one clip."""
        name = encoded.clip.action or encoded.clip.style or "no label"
        if encoded.dropped[SHORT]:
            self.dropped[name] += encoded.dropped[SHORT]
        for window, _, _ in encoded.windows:
            self._window(window, name, split)

    def _window(self, window: Window, name: str, split: str) -> None:
        self.cropped += window.cropped
        self.rest += window.rest
        self.rest_frames += window.length * window.rest
        # The window of a segment of 2 s has a frame and up to a unit less.
        self.kept[name] += window.length < (PAPERS_LEAST * self.fps - 1) // UNIT * UNIT
        for caption in window.captions:
            self.captions[caption.source or "no source"][split] += 1

    def report(self) -> dict[str, Any]:
        """`long`: windows drawn from a longer captioned segment, and those of the rest of captioned clips, which have
        no caption; `short`: windows below 2 s that are kept, and segments dropped as too short, by action (or style);
        `caption_sources`: captions by source and split."""
        minutes = round(self.rest_frames / self.fps / 60, 3)
        return {
            "long": {"cropped": self.cropped, "rest_windows": self.rest, "rest_minutes": minutes},
            "short": {"below_seconds": PAPERS_LEAST, "kept": _sorted(self.kept), "dropped": _sorted(self.dropped)},
            "caption_sources": {source: _sorted(counts) for source, counts in sorted(self.captions.items())},
        }


def _sorted(counts: Counter[str]) -> dict[str, int]:
    return dict(sorted((+counts).items()))
