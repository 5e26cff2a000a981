"""Captioned windows as judges read them: sentences through the frozen language model, motions as joints alone, and
every source of captions alike."""

from __future__ import annotations

import numpy as np
import torch

from motionary.corpus.batch import Batch, Dataset
from motionary.corpus.datasets import Pairs, gather
from motionary.corpus.store import Corpus
from motionary.language import TextStates

FEWEST = 8  # captions of a source that is counted: fewer find each other by chance


class Described:
    """Captioned windows with the frozen token states of their captions, and their joints where asked for.

    Every second caption is read as its normalized words: captioners may write those, and a judge of them must have
    seen such.

    Args:
        pairs: the windows and captions; only whole windows (``drop_unit=0``) where joints are asked for.
        states: of the language model.
        joints: also give `joints`, of windows decoded once.
        raw: read every caption as it was written (validation and test).
    """

    def __init__(self, pairs: Pairs, states: TextStates, joints: bool = False, raw: bool = False):
        self.pairs, self.states = pairs, states
        self.lengths, self.weights = pairs.lengths, pairs.weights
        self.joints = WindowJoints(pairs.corpus, np.unique(pairs.rows)) if joints else None
        captions = pairs.corpus.captions
        self.texts = captions.text.copy()
        if not raw:
            for row in range(1, len(captions), 2):
                self.texts[row] = " ".join(captions.words[row]) or captions.text[row]

    def __len__(self) -> int:
        return len(self.pairs)

    def collate(self, indices: np.ndarray, rng: np.random.Generator) -> Batch:
        """The batch of `pairs` with `states`, `state_count`, and `joints` where asked for."""
        batch = self.pairs.collate(indices, rng)
        states, count = self.states([str(self.texts[row]) for row in batch.caption.numpy()])
        batch.states, batch.state_count = torch.from_numpy(states), torch.from_numpy(count)
        if self.joints is not None:
            batch.joints = torch.from_numpy(self.joints(batch.clip.numpy(), batch.frames.numpy()))
        return batch


class WindowJoints:
    """Joint positions of windows of a corpus, decoded once and held in memory: 6 bytes a joint, 12 a frame.

    Args:
        corpus: that holds the windows.
        rows: those that will be asked for.
    """

    def __init__(self, corpus: Corpus, rows: np.ndarray):
        codec, fps, length = corpus.context.make_codec(), corpus.context.fps, corpus.clips.length[rows]
        joints = len(corpus.context.skeleton)
        self.offset = np.full(len(corpus), -1, dtype=np.int64)
        self.offset[rows] = np.cumsum(length) - length
        # The root's path in full precision; joints relative to it are small, and half precision keeps them to 0.5 mm.
        self.root = np.empty((int(length.sum()), 1, 3), np.float32)
        self.around = np.empty((int(length.sum()), joints, 3), np.float16)
        for row in rows:
            positions = codec.decode(corpus.features(row), fps=fps).positions
            place = slice(self.offset[row], self.offset[row] + len(positions))
            self.root[place] = positions[:, :1]
            self.around[place] = positions - positions[:, :1]

    def __call__(self, rows: np.ndarray, frames: np.ndarray) -> np.ndarray:
        """(B, T, J, 3) float32 positions of the first `frames` (B,) frames of windows, zero beyond."""
        where = (self.offset[rows], frames, int(frames.max()))
        return gather(self.root, *where) + gather(self.around, *where).astype(np.float32)


class EvenSources:
    """Captions of a dataset, as many of every source, so that a mean over all is the mean over sources.

    Sources of fewer than 8 captions are left out where there are others; small ones repeat. Entries of one source
    stand together, and their number is a multiple of `together`: batches of that size, in order, hold one source each.

    Args:
        pairs: with one entry a caption (``all_captions=True``).
        dataset: the same entries as they shall come; `pairs` where None.
        together: entries of a batch.
        most: entries of a source at most; more are left out evenly.
    """

    weights: np.ndarray | None = None

    def __init__(self, pairs: Pairs, dataset: Dataset | None = None, together: int = 64, most: int = 512):
        self.dataset = pairs if dataset is None else dataset
        source = pairs.corpus.captions.source[pairs.first]
        names, counts = np.unique(source, return_counts=True)
        kept = names[counts >= FEWEST] if (counts >= FEWEST).any() else names
        self.sources = tuple(str(name) for name in kept)
        largest = min(max(counts[np.isin(names, kept)]), most)
        each = -(-int(largest) // together) * together
        self.entries = np.concatenate([_spread(np.flatnonzero(source == name), each) for name in kept])
        self.lengths = self.dataset.lengths[self.entries]

    def __len__(self) -> int:
        return len(self.entries)

    def collate(self, indices: np.ndarray, rng: np.random.Generator) -> Batch:
        """The batch of the given entries."""
        return self.dataset.collate(self.entries[indices], rng)


def _spread(entries: np.ndarray, count: int) -> np.ndarray:
    """`count` of the entries: evenly over them where there are more, repeated where there are fewer."""
    if len(entries) <= count:
        return np.resize(entries, count)
    return entries[np.arange(count) * len(entries) // count]
