"""Captioned motions in a system's own features, with their captions as a language model reads them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import torch

from motionary.corpus.batch import Batch
from motionary.corpus.context import Context
from motionary.corpus.datasets import Pairs
from motionary.corpus.ragged import Ragged
from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.features import Codec
from motionary.motion import Motion, resample


def own_features(motion: Motion, codec: Codec, fps: float) -> np.ndarray:
    """(T, D) float32 features of a motion by another codec at another rate, one for each frame.

    A codec needs a frame more than it gives features for; the last step is repeated for it.
    """
    motion = resample(motion, fps)
    before = motion.positions[-2:-1] if motion.frames > 1 else motion.positions[-1:]
    positions = np.concatenate([motion.positions, 2 * motion.positions[-1:] - before])
    rotations = motion.rotations
    if rotations is not None:
        rotations = np.concatenate([rotations, rotations[-1:]])
    return codec.encode(Motion(positions, motion.fps, motion.skeleton, rotations))


def from_corpus(features: np.ndarray, context: Context, codec: Codec, fps: float) -> np.ndarray:
    """`own_features` of raw features (T, D) of the corpus."""
    return own_features(context.make_codec().decode(features, fps=context.fps), codec, fps)


def all_from_corpus(corpus: Corpus, codec: Codec, fps: float) -> Iterator[np.ndarray]:
    """`own_features` of every window of a corpus, in order."""
    return (from_corpus(corpus.features(row), corpus.context, codec, fps) for row in range(len(corpus)))


class Refeatured:
    """A :class:`Pairs` whose batches hold other features, and what a language model makes of the caption.

    Args:
        pairs: says which clips, and draws their captions; made with ``motion=False, drop_unit=0``.
        features: of every window of the corpus.
        texts: one row for each caption of the corpus, by `caption_row`.
        caption_row: (captions,) row of `texts`, -1 for captions that are not there.
        max_frames: longer windows are left out (TEMOS 0.A.1); 0 keeps all.

    Raises:
        InputError: no window is short enough.
    """

    def __init__(self, pairs: Pairs, features: Ragged, texts: Ragged, caption_row: np.ndarray, max_frames: int = 0):
        self.pairs, self.features, self.texts, self.caption_row = pairs, features, texts, caption_row
        lengths = features.lengths[pairs.rows]
        self.chosen = np.flatnonzero(lengths <= max_frames) if max_frames else np.arange(len(lengths))
        if not len(self.chosen):
            raise InputError("max_frames", max_frames, f"must leave a window; the shortest has {lengths.min()} frames")
        self.lengths = lengths[self.chosen]
        weights = pairs.weights
        self.weights = None if weights is None else weights[self.chosen] / weights[self.chosen].sum()

    def __len__(self) -> int:
        return len(self.chosen)

    def collate(self, indices: np.ndarray, rng: np.random.Generator) -> Batch:
        """Batch of the given entries: those of `Pairs`, with motion, frames, states and state_count."""
        batch = self.pairs.collate(self.chosen[indices], rng)
        motion, frames = self.features.padded(batch.clip.numpy())
        text, count = self.texts.padded(self.caption_row[batch.caption.numpy()])
        batch.motion, batch.frames = torch.from_numpy(motion), torch.from_numpy(frames)
        batch.states, batch.state_count = torch.from_numpy(text), torch.from_numpy(count)
        return batch


def caption_texts(corpus: Corpus, datasets: Sequence[Pairs]) -> tuple[list[str], np.ndarray]:
    """The distinct texts of all captions that these datasets may draw, and (captions,) each caption's place among
    them, -1 for the others."""
    place = np.full(len(corpus.captions), -1, dtype=np.int64)
    known: dict[str, int] = {}
    for pairs in datasets:
        for first, last in zip(pairs.first, pairs.last, strict=True):
            for caption in range(first, last):
                place[caption] = known.setdefault(str(corpus.captions.text[caption]), len(known))
    return list(known), place


def statistics(rows: Iterable[int], features: Ragged) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation (D,) float32 over all frames of these rows; no deviation below a millimetre, or a
    thousandth of the feature's unit, since what hardly changes would be made of noise."""
    total, squares, count = 0.0, 0.0, 0
    for row in rows:
        values = features[row].astype(np.float64)
        total, squares, count = total + values.sum(0), squares + np.square(values).sum(0), count + len(values)
    mean = total / count
    deviation = np.sqrt(np.maximum(squares / count - np.square(mean), 0))
    return np.asarray(mean, np.float32), np.maximum(deviation, 1e-3).astype(np.float32)
