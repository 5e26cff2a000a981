"""What batches are drawn from: windows of motion, and captioned motions. All gathers are vectorized."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from motionary.corpus.batch import Batch
from motionary.corpus.caption_weights import CaptionWeights
from motionary.corpus.caption_words import encode_captions, source_ids
from motionary.corpus.store import Corpus
from motionary.corpus.token_store import TokenStore
from motionary.errors import InputError
from motionary.language import Vocabulary


class Windows:
    """Windows of fixed length for autoencoder and tokenizer, from captioned and uncaptioned clips alike.

    A clip appears once per `window` frames it has (`uniform=True`: once), so long clips count by their length. With
    `random` the start is drawn anew each time, otherwise windows lie evenly over the clip. A clip shorter than the
    window comes whole, padded with zeros; `frames` says how many are valid.

    Args:
        split: "train", "val" or "test".
        window: frames.
        random: random starts; by default only in training.
        balance: how much more often clips of small roots are drawn (with replacement; epochs keep length): see
            :func:`balanced`.

    Attributes:
        starts_in_all: windows that the clips hold, one for each frame that one may start at: what the released code
            calls an epoch.
    """

    def __init__(
        self,
        corpus: Corpus,
        split: str = "train",
        window: int = 64,
        *,
        random: bool | None = None,
        uniform: bool = False,
        balance: float = 0.0,
    ):
        if window < 1:
            raise InputError("window", window, "must be at least 1 frame")
        self.corpus, self.window = corpus, window
        self.random = split == "train" if random is None else random
        rows = _rows(corpus, split, None)
        length = corpus.clips.length[rows]
        copies = np.ones_like(length) if uniform else np.maximum(length // window, 1)
        self.rows = np.repeat(rows, copies)
        nth = np.arange(len(self.rows)) - np.repeat(np.cumsum(copies) - copies, copies)
        spare = np.maximum(corpus.clips.length[self.rows] - window, 0)
        self.starts = spare * nth // np.maximum(np.repeat(copies, copies) - 1, 1)
        self.lengths = np.minimum(corpus.clips.length[self.rows], window)
        self.weights = balanced(corpus.clips.group[self.rows], balance)
        self.starts_in_all = int((np.maximum(corpus.clips.length[rows] - window, 0) + 1).sum())

    def __len__(self) -> int:
        return len(self.rows)

    def collate(self, indices: np.ndarray, rng: np.random.Generator) -> Batch:
        """Batch of the given entries: clip, motion (B, window, D), frames, style, action."""
        rows, count, start = self.rows[indices], self.lengths[indices], self.starts[indices]
        if self.random:
            start = rng.integers(0, self.corpus.clips.length[rows] - count + 1)
        motion = gather(self.corpus.frames, self.corpus.clips.offset[rows] + start, count, self.window)
        return Batch(
            clip=_long(rows), motion=torch.from_numpy(motion), frames=_long(count), **_labels(self.corpus, rows)
        )


class Pairs:
    """Captioned windows at their full length, with one caption each.

    Windows and captions are drawn in proportion to the weights of captions, where `data.source_weights` has any.

    Args:
        split: "train", "val" or "test".
        tokens: adds the motion tokens of each window; several stores hold those of the windows from their first,
            second, ... frame on, and each draw takes one of them (the first unless `random`).
        drop_unit: in this share of the draws one unit (4 frames, 1 token) is dropped from head or tail; only where
            `random`.
        balance: as for :class:`Windows`.
        shifts: motion starts at one of the first `shifts` frames where `random`; with `tokens`, one store for each.
        all_captions: one entry per caption in place of one per clip.
        random: draw the caption (and the dropped unit) at random; by default only in training without
            `all_captions`. Otherwise an entry is a clip's first caption.
        max_words: longer captions are cut.
        motion: False leaves the features out (token models do not need them).
        mirrored: False leaves out the mirrored copies that preprocess added.
        written: gives the captions' words as they were written, in this vocabulary, in place of normalized ones.
        most_captions: of a clip that are drawn, its first ones; 0 takes all.
        sources: adds the source of each caption, as its position here.
        said: adds the captions' words as they were written, in this vocabulary, beside the normalized ones.
    """

    def __init__(
        self,
        corpus: Corpus,
        split: str = "train",
        tokens: TokenStore | Sequence[TokenStore] | None = None,
        drop_unit: float = 1 / 3,
        balance: float = 0.0,
        shifts: int = 1,
        all_captions: bool = False,
        *,
        random: bool | None = None,
        max_words: int = 20,
        motion: bool = True,
        mirrored: bool = True,
        written: Vocabulary | None = None,
        most_captions: int = 0,
        sources: Sequence[str] = (),
        said: Vocabulary | None = None,
    ):
        stores = () if tokens is None else (tokens,) if isinstance(tokens, TokenStore) else tuple(tokens)
        for store in stores:
            if len(store) != len(corpus):
                raise InputError("tokens", len(store), f"must have one entry per window of the corpus, {len(corpus)}")
        if not 1 <= shifts <= corpus.context.unit:
            raise InputError("shifts", shifts, f"must lie in 1..{corpus.context.unit}")
        if stores and len(stores) != shifts:
            raise InputError("tokens", f"{len(stores)} stores", f"must be one for each of {shifts} shifts")
        if not 0 <= drop_unit <= 1:
            raise InputError("drop_unit", drop_unit, "must lie in 0..1")
        self.corpus, self.drop_unit, self.shifts, self.with_motion = corpus, drop_unit, shifts, motion
        self.tokens = _flat(stores) if stores else None
        self.random = (split == "train" and not all_captions) if random is None else random
        rows = _rows(corpus, split, True)
        if not mirrored:
            rows = rows[~corpus.added[rows]]
        first, last = corpus.caption_start[rows], corpus.caption_start[rows + 1]
        if most_captions:
            last = np.minimum(last, first + most_captions)
        if all_captions:
            rows = np.repeat(rows, last - first)
            first = np.flatnonzero(np.isin(corpus.captions.clip, rows))
            last = first + 1
        self.rows, self.first, self.last = rows, first, last
        self.lengths = corpus.clips.length[rows]
        self.drawn = CaptionWeights(corpus.captions.weight, first, last)
        self.weights = self.drawn.times(balanced(corpus.clips.group[rows], balance))
        self.words, self.tags, self.word_count = encode_captions(corpus, max_words, written)
        self.source = source_ids(corpus, sources) if sources else None
        self.said = None if said is None else encode_captions(corpus, max_words, said)

    def __len__(self) -> int:
        return len(self.rows)

    def collate(self, indices: np.ndarray, rng: np.random.Generator) -> Batch:
        """Batch of the given entries with every field set (motion and tokens where asked for)."""
        rows, caption = self.rows[indices], self.first[indices]
        count, start = self.corpus.clips.length[rows], np.zeros(len(rows), dtype=np.int64)
        unit, shift = self.corpus.context.unit, np.zeros(len(rows), dtype=np.int64)
        if self.random:
            caption = self.drawn.draw(indices, rng)
            if self.shifts > 1:
                # What is left is whole units, as many for the motion as for its tokens.
                shift = np.where(count >= 2 * unit, rng.integers(0, self.shifts, len(rows)), 0)
                count = np.where(shift > 0, (count - shift) // unit * unit, count)
            drop = (rng.random(len(rows)) < self.drop_unit) & (count > unit)
            start = np.where(drop & (rng.random(len(rows)) < 0.5), unit, 0)
            count = count - unit * drop
        words = self.word_count[caption]
        batch = Batch(
            clip=_long(rows),
            frames=_long(count),
            words=_long(self.words[caption, : words.max()]),
            tags=_long(self.tags[caption, : words.max()]),
            word_count=_long(words),
            text_key=_long(self.corpus.captions.key[caption]),
            caption=_long(caption),
            **_labels(self.corpus, rows),
        )
        if self.source is not None:
            batch.source = _long(self.source[caption])
        if self.said is not None:
            said, _, length = self.said
            batch.said = _long(said[caption, : length[caption].max()])
        if self.with_motion:
            offset = self.corpus.clips.offset[rows] + shift + start
            batch.motion = torch.from_numpy(gather(self.corpus.frames, offset, count, int(count.max())))
        if self.tokens is not None:
            flat, offsets = self.tokens
            tokens = gather(flat, offsets[shift, rows] + start // unit, count // unit, int(count.max()) // unit)
            batch.tokens, batch.token_count = _codes(tokens), _long(count // unit)
        return batch


def _rows(corpus: Corpus, split: str, captioned: bool | None) -> np.ndarray:
    rows = corpus.rows(split, captioned)
    if not len(rows):
        kind = "captioned windows" if captioned else "windows"
        if captioned and not len(corpus.captions):
            rule = "this learns from captions, and the corpus has none; `make repro` trains what needs none"
            raise InputError(corpus.folder, "no caption", rule)
        raise InputError(corpus.folder, split, f"split has no {kind}; add clips or change data.ratios or data.seed")
    return rows


def _flat(stores: Sequence[TokenStore]) -> tuple[np.ndarray, np.ndarray]:
    """The tokens of all stores one after the other, and where each store's windows start (stores, clips)."""
    before = np.cumsum([0, *(len(store.tokens) for store in stores[:-1])])
    offsets = np.stack([store.offsets[:-1] + start for store, start in zip(stores, before, strict=True)])
    return np.concatenate([store.tokens for store in stores]), offsets


def balanced(groups: np.ndarray, balance: float) -> np.ndarray | None:
    """(entries,) draw probabilities by the group of each entry, or None for every entry once.

    A group's share is proportional to its size to the power of 1 - balance: 0 draws every entry alike, 1 every group.
    """
    if not 0 <= balance <= 1:
        raise InputError("balance", balance, "must lie in 0..1")
    found, place, count = np.unique(groups, return_inverse=True, return_counts=True)
    if not balance or len(found) < 2:
        return None
    weights = count[place].astype(np.float64) ** -balance
    return weights / weights.sum()


def gather(values: np.ndarray, offset: np.ndarray, count: np.ndarray, length: int) -> np.ndarray:
    """(B, length, ...) stretches of `values` from `offset`, zero beyond `count`."""
    step = np.arange(length)
    # Padding re-reads the first frame of the stretch (always a valid index), then is zeroed.
    index = offset[:, None] + np.where(step < count[:, None], step, 0)
    out = values[index]
    out[step >= count[:, None]] = 0
    return out


def _labels(corpus: Corpus, rows: np.ndarray) -> dict[str, Tensor]:
    return {"style": _long(corpus.style_ids[rows]), "action": _long(corpus.action_ids[rows])}


def _codes(values: np.ndarray) -> Tensor:
    """Codes of a codebook, or vectors."""
    return torch.from_numpy(values) if values.dtype.kind == "f" else _long(values)


def _long(values: np.ndarray) -> Tensor:
    return torch.from_numpy(np.asarray(values, dtype=np.int64))
