"""Labeled motions as joints: what models of actions and their judge learn from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from motionary.corpus.batch import Batch
from motionary.corpus.datasets import balanced
from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.motion.facing import heading, rotate_y


@dataclass(frozen=True, eq=False)
class ActionLabels:
    """The actions of a corpus.

    Attributes:
        coarse: names of the actions.
        fine: "action/style" names, of the pairs that training shows; none where the corpus names fewer than two styles.
        action, fine_ids: (clips,) label ids of every window, -1 where unknown.
    """

    coarse: tuple[str, ...]
    fine: tuple[str, ...]
    action: np.ndarray
    fine_ids: np.ndarray

    @classmethod
    def of(cls, corpus: Corpus) -> ActionLabels:
        """Of all windows of a corpus; a class that no training window shows is unknown."""
        clips, train = corpus.clips, corpus.clips.split == "train"
        pairs = np.array(
            [f"{a}/{s}" if a and s else "" for a, s in zip(clips.action, clips.style, strict=True)], object
        )
        styled = len(set(clips.style[train].tolist()) - {""}) >= 2
        coarse, fine = _seen(clips.action[train]), _seen(pairs[train]) if styled else ()
        return cls(coarse, fine, _ids(clips.action, coarse), _ids(pairs, fine))

    def rows(self, corpus: Corpus, split: str, mirrored: bool = True) -> np.ndarray:
        """Labeled window rows of a split, with the mirrored copies that were added or without."""
        rows = corpus.rows(split)
        return rows[(self.action[rows] >= 0) & (mirrored | ~corpus.added[rows])]

    def held(self, corpus: Corpus) -> np.ndarray:
        """Labeled rows of the validation split; those of training where it has none, as in small corpora."""
        rows = self.rows(corpus, "val")
        return rows if len(rows) else self.rows(corpus, "train")


class Acted:
    """Chosen windows of a corpus as joints, one entry each.

    Args:
        corpus: that holds the windows.
        labels: of its windows.
        rows: of the corpus.
        window: frames; longer windows of the corpus give a stretch of this many, shorter ones come whole, padded, since
            brief actions have no others (see `lengths_told`).
        random: draw the stretch anew each time; otherwise it is the middle one.
        balance: how much more often rare actions are drawn; see :func:`motionary.corpus.datasets.balanced`.
    """

    def __init__(
        self,
        corpus: Corpus,
        labels: ActionLabels,
        rows: np.ndarray,
        window: int,
        *,
        random: bool = True,
        balance: float = 0.0,
    ):
        if window < 1:
            raise InputError("window", window, "must be at least 1 frame")
        self.rows, self.window, self.random = np.asarray(rows), window, random
        self.action, self.fine = labels.action[self.rows], labels.fine_ids[self.rows]
        motions = [corpus.motion(int(row)) for row in self.rows]
        self._joints = [motion.positions for motion in motions]
        self._headings = [heading(motion) for motion in motions]
        self.whole = np.array([len(joints) for joints in self._joints], np.int64)  # frames, before a stretch is cut out
        self.lengths = np.minimum(self.whole, window)
        self.weights = balanced(self.action, balance)

    def __len__(self) -> int:
        return len(self.rows)

    def collate(self, indices: np.ndarray, rng: np.random.Generator) -> Batch:
        """Batch of the given entries: clip, joints (B, T, J, 3), frames, action, fine."""
        count = self.lengths[indices]
        spare = np.array([len(self._joints[i]) for i in indices]) - count
        starts = rng.integers(0, spare + 1) if self.random else spare // 2
        joints = np.zeros((len(indices), int(count.max()), *self._joints[0].shape[1:]), np.float32)
        for place, (entry, start, frames) in enumerate(zip(indices, starts, count, strict=True)):
            joints[place, :frames] = self.stretch(int(entry), int(start), int(frames))
        return Batch(
            clip=torch.from_numpy(self.rows[indices]),
            joints=torch.from_numpy(joints),
            frames=torch.from_numpy(count),
            action=torch.from_numpy(self.action[indices]),
            fine=torch.from_numpy(self.fine[indices]),
        )

    def stretch(self, entry: int, start: int, frames: int) -> np.ndarray:
        """(frames, J, 3) joints of an entry, brought to start above the origin, facing +z; heights stay."""
        found = self._joints[entry][start : start + frames]
        shift = found[0, 0] * np.array([1, 0, 1], np.float32)
        return rotate_y(found - shift, -float(self._headings[entry][start]))


def lengths_told(data: Acted, stage: str) -> dict[str, int]:
    """Counts the entries that are shorter than the window, for the report of `stage`. Prints one line if there are any,
    and another if all are: the model then never sees a motion as long as it was meant to learn.

    Returns:
        entries, those shorter than the window, and the most frames of an entry.
    """
    found = {"windows": len(data), "shorter": int((data.whole < data.window).sum()), "longest": int(data.whole.max())}
    asked = f"{stage}.window, {data.window} frames"
    if found["shorter"] == len(data):
        print(f"{stage}: no training window is as long as {asked}: the longest has {found['longest']}")
    elif found["shorter"]:
        print(f"{stage}: {found['shorter']} of {len(data)} training windows are shorter than {asked}; they are padded")
    return found


def _seen(names: np.ndarray) -> tuple[str, ...]:
    return tuple(sorted(set(names.tolist()) - {""}))


def _ids(names: np.ndarray, known: tuple[str, ...]) -> np.ndarray:
    place = {name: i for i, name in enumerate(known)}
    return np.array([place.get(name, -1) for name in names], np.int64)
