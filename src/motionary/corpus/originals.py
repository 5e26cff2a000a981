"""What windows were cut from, at the rate of its source: metrics that want the recorded frames read them again."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from pathlib import Path

from motionary.corpus.clips import Clip
from motionary.corpus.config import DataConfig
from motionary.corpus.shared_rigs import with_shared_rigs
from motionary.corpus.sources import open_sources
from motionary.corpus.store import Corpus
from motionary.corpus.workers import without_bind_pose
from motionary.errors import InputError
from motionary.motion import Motion, canonicalize, retarget


class Originals:
    """The clips of a corpus's sources.

    Args:
        corpus: that was made of them.
        config: the `data` section that it was made by.
        base: where relative roots start.
    """

    def __init__(self, corpus: Corpus, config: DataConfig, base: Path):
        self.corpus, self.config, self.base = corpus, config, base

    @cached_property
    def _clips(self) -> dict[str, Clip]:
        clips = [clip for source in open_sources(self.config, self.base) for clip in source.clips()[0]]
        return {clip.id: clip for clip in with_shared_rigs(clips)}

    def motion(self, row: int) -> Motion | None:
        """Window `row` on the corpus's skeleton, from its first to its last frame at the source's rate, canonical; None
        where the source has no more frames than the corpus.

        Raises:
            InputError: the clip is not in the sources any more, or the window is a mirrored copy.
        """
        clips, context = self.corpus.clips, self.corpus.context
        name = str(clips.origin[row])
        if name not in self._clips or clips.mirrored[row]:
            raise InputError("window", clips.id[row], "must be of a clip in data.roots, and not mirrored")
        motion, _ = self._clips[name].load(self._clips[name])
        if motion.fps <= context.fps * 1.001:
            return None
        begin = round(float(clips.start[row]) * context.fps) / context.fps
        end = begin + (clips.length[row] - 1) / context.fps
        motion = retarget(without_bind_pose(motion), context.skeleton)
        first, last = round(begin * motion.fps), min(round(end * motion.fps), motion.frames - 1)
        found = canonicalize(motion.crop(first, last + 1))
        # The corpus's floor is below its own frames; between them a foot may be lower.
        down = found.positions[0, 0, 1] - self.corpus.motion(row).positions[0, 0, 1]
        return replace(found, positions=found.positions - [0, down, 0])
