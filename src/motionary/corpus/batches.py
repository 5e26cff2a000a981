"""Batches of windows, captions and motion tokens: vectorized gathers, resumable at any step."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from ..errors import InputError
from ..language import PAD, Sentence
from .store import Corpus


@dataclass
class Batch:
    """One batch; every field but `clip` is optional.

    Attributes:
        clip: (B,) rows of the corpus.
        motion: (B, T, D) float32 raw features, zero beyond `frames`.
        frames: (B,) valid frames.
        words: (B, N) ids START .. END, then PAD; `word_count` (B,) counts START and END; `tags` (B, N).
        text_key: (B,) id of the distinct normalized text; `caption` (B,) caption row.
        tokens: (B, S) motion codes 0 .. K-1, zero beyond `token_count` (B,).
        style, action: (B,) label ids of the corpus's context, -1 where unknown.
    """

    clip: Tensor
    motion: Tensor | None = None
    frames: Tensor | None = None
    words: Tensor | None = None
    word_count: Tensor | None = None
    tags: Tensor | None = None
    text_key: Tensor | None = None
    caption: Tensor | None = None
    tokens: Tensor | None = None
    token_count: Tensor | None = None
    style: Tensor | None = None
    action: Tensor | None = None

    def __len__(self) -> int:
        return len(self.clip)

    def to(self, device) -> Batch:
        """The same batch on another device."""
        moved = {
            field.name: value.to(device, non_blocking=True)
            for field in fields(self)
            if (value := getattr(self, field.name)) is not None
        }
        return replace(self, **moved)


class Dataset(Protocol):
    """What `Batches` needs: a length, valid frames per entry, sampling weights or None, and a collate function."""

    lengths: np.ndarray
    weights: np.ndarray | None

    def __len__(self) -> int: ...

    def collate(self, indices: np.ndarray, rng: np.random.Generator) -> Batch: ...


class TokenStore:
    """The motion tokens of every window of a corpus, flat.

    Args:
        tokens: (N,) codes of all windows one after the other.
        offsets: (clips + 1,) where each window's tokens start.
    """

    def __init__(self, tokens: np.ndarray, offsets: np.ndarray):
        if offsets[0] != 0 or offsets[-1] != len(tokens) or (np.diff(offsets) < 0).any():
            raise InputError("offsets", offsets[-1], f"must rise from 0 to the number of tokens, {len(tokens)}")
        self.tokens, self.offsets = tokens, offsets

    @classmethod
    def collect(cls, sequences: Sequence[np.ndarray]) -> TokenStore:
        """From one code sequence per corpus row."""
        offsets = np.concatenate([[0], np.cumsum([len(codes) for codes in sequences])]).astype(np.int64)
        flat = np.concatenate(sequences) if len(sequences) else np.zeros(0)
        small = not flat.size or flat.max() <= np.iinfo(np.int16).max
        return cls(flat.astype(np.int16 if small else np.int32), offsets)

    def save(self, folder: str | Path) -> None:
        """Write tokens.npy and offsets.npy."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        np.save(folder / "tokens.npy", self.tokens)
        np.save(folder / "offsets.npy", self.offsets)

    @classmethod
    def load(cls, folder: str | Path) -> TokenStore:
        """Read what `save` wrote."""
        try:
            return cls(*(np.load(Path(folder) / name) for name in ("tokens.npy", "offsets.npy")))
        except OSError as error:
            raise InputError(folder, error, "must hold tokens.npy and offsets.npy; run the tokenizer stage") from None

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def __getitem__(self, i: int) -> np.ndarray:
        return self.tokens[self.offsets[i] : self.offsets[i + 1]]


class Windows:
    """Windows of fixed length for autoencoder and tokenizer, from captioned and uncaptioned clips alike.

    A clip appears once per `window` frames it has (`uniform=True`: once), so long clips count by their length. With
    `random` the start is drawn anew each time, otherwise windows lie evenly over the clip. A clip shorter than the
    window comes whole, padded with zeros; `frames` says how many are valid.

    Args:
        split: "train", "val" or "test".
        window: frames.
        random: random starts; by default only in training.
        group_weights: root name -> how much more often its clips are drawn (with replacement; epochs keep length).
    """

    def __init__(
        self,
        corpus: Corpus,
        split: str = "train",
        window: int = 64,
        *,
        random: bool | None = None,
        uniform: bool = False,
        group_weights: Mapping[str, float] | None = None,
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
        self.weights = _weights(corpus, self.rows, group_weights)

    def __len__(self) -> int:
        return len(self.rows)

    def collate(self, indices: np.ndarray, rng: np.random.Generator) -> Batch:
        """Batch of the given entries: clip, motion (B, window, D), frames, style, action."""
        rows, count, start = self.rows[indices], self.lengths[indices], self.starts[indices]
        if self.random:
            start = rng.integers(0, self.corpus.clips.length[rows] - count + 1)
        motion = _gather(self.corpus.frames, self.corpus.clips.offset[rows] + start, count, self.window)
        return Batch(
            clip=_long(rows), motion=torch.from_numpy(motion), frames=_long(count), **_labels(self.corpus, rows)
        )


class Pairs:
    """Captioned windows at their full length, with one caption each.

    Args:
        split: "train", "val" or "test".
        tokens: adds the motion tokens of each window.
        drop_unit: in this share of the draws one unit (4 frames, 1 token) is dropped from head or tail; only where
            `random`.
        weights: root name -> how much more often its clips are drawn (with replacement; epochs keep length).
        all_captions: one entry per caption in place of one per clip.
        random: draw the caption (and the dropped unit) at random; by default only in training without
            `all_captions`. Otherwise an entry is a clip's first caption.
        max_words: longer captions are cut.
        motion: False leaves the features out (token models do not need them).
        mirrored: False leaves the mirrored copies out.
    """

    def __init__(
        self,
        corpus: Corpus,
        split: str = "train",
        tokens: TokenStore | None = None,
        drop_unit: float = 1 / 3,
        weights: Mapping[str, float] | None = None,
        all_captions: bool = False,
        *,
        random: bool | None = None,
        max_words: int = 20,
        motion: bool = True,
        mirrored: bool = True,
    ):
        if tokens is not None and len(tokens) != len(corpus):
            raise InputError("tokens", len(tokens), f"must have one entry per window of the corpus, {len(corpus)}")
        if not 0 <= drop_unit <= 1:
            raise InputError("drop_unit", drop_unit, "must lie in 0..1")
        self.corpus, self.tokens, self.drop_unit, self.with_motion = corpus, tokens, drop_unit, motion
        self.random = (split == "train" and not all_captions) if random is None else random
        rows = _rows(corpus, split, True)
        if not mirrored:
            rows = rows[~corpus.clips.mirrored[rows]]
        first, last = corpus.caption_start[rows], corpus.caption_start[rows + 1]
        if all_captions:
            rows = np.repeat(rows, last - first)
            first = np.flatnonzero(np.isin(corpus.captions.clip, rows))
            last = first + 1
        self.rows, self.first, self.last = rows, first, last
        self.lengths = corpus.clips.length[rows]
        self.weights = _weights(corpus, rows, weights)
        self.words, self.tags, self.word_count = _encode(corpus, max_words)

    def __len__(self) -> int:
        return len(self.rows)

    def collate(self, indices: np.ndarray, rng: np.random.Generator) -> Batch:
        """Batch of the given entries with every field set (motion and tokens where asked for)."""
        rows, caption = self.rows[indices], self.first[indices]
        count, start = self.corpus.clips.length[rows], np.zeros(len(rows), dtype=np.int64)
        unit = self.corpus.context.unit
        if self.random:
            caption = rng.integers(self.first[indices], self.last[indices])
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
        if self.with_motion:
            offset = self.corpus.clips.offset[rows] + start
            batch.motion = torch.from_numpy(_gather(self.corpus.frames, offset, count, int(count.max())))
        if self.tokens is not None:
            offset = self.tokens.offsets[rows] + start // unit
            tokens = _gather(self.tokens.tokens, offset, count // unit, int(count.max()) // unit)
            batch.tokens, batch.token_count = _long(tokens), _long(count // unit)
        return batch


class Batches:
    """Batches of a dataset, the same for the same seed whatever was drawn before.

    The order of an epoch comes from (seed, epoch) and the draws inside a batch from (seed, epoch, index, rank), so
    `epoch(e, start=k)` continues an interrupted epoch exactly.

    Args:
        batch_size: entries per batch and rank.
        shuffle: draw a new order each epoch; datasets with weights are then drawn with replacement.
        drop_last: leave the incomplete last batch out (kept where it is the only one).
        rank, world: this process and the number of processes; each takes its share of every global batch. An
            incomplete global batch is filled from the start of the order, so that all ranks take equal steps.
        length_sorted: put entries of similar length together (within stretches of 16 batches when shuffling), since
            recurrent and attention models pay for the longest of a batch.
    """

    def __init__(
        self,
        dataset: Dataset,
        batch_size: int,
        seed: int = 0,
        shuffle: bool = True,
        drop_last: bool = False,
        rank: int = 0,
        world: int = 1,
        length_sorted: bool = False,
    ):
        if batch_size < 1:
            raise InputError("batch_size", batch_size, "must be at least 1")
        if not 0 <= rank < world:
            raise InputError("rank", rank, f"must lie in 0..{world - 1}")
        if len(dataset) == 0:
            raise InputError("dataset", "empty", "must hold at least one entry; is the split empty?")
        self.dataset, self.batch_size, self.seed = dataset, batch_size, seed
        self.shuffle, self.drop_last, self.length_sorted = shuffle, drop_last, length_sorted
        self.rank, self.world = rank, world

    def __len__(self) -> int:
        """Batches per epoch."""
        full, rest = divmod(len(self.dataset), self.batch_size * self.world)
        return full + (rest > 0 and (not self.drop_last or full == 0))

    def order(self, epoch: int) -> list[np.ndarray]:
        """Dataset indices of each global batch of an epoch."""
        count, size = len(self.dataset), self.batch_size * self.world
        rng = np.random.default_rng([self.seed, epoch])
        order = np.arange(count)
        if self.shuffle and self.dataset.weights is not None:
            order = rng.choice(count, count, p=self.dataset.weights)
        elif self.shuffle:
            order = rng.permutation(count)
        if self.length_sorted:
            stretch = 16 * size if self.shuffle else count
            parts = [order[i : i + stretch] for i in range(0, count, stretch)]
            order = np.concatenate([p[np.argsort(self.dataset.lengths[p], kind="stable")] for p in parts])
        batches = [order[i : i + size] for i in range(0, count, size)][: len(self)]
        short = -len(batches[-1]) % self.world
        batches[-1] = np.concatenate([batches[-1], np.resize(order, short)])
        if self.length_sorted and self.shuffle:
            batches = [batches[i] for i in rng.permutation(len(batches))]
        return batches

    def epoch(self, epoch: int, start: int = 0) -> Iterator[Batch]:
        """The batches of this rank in an epoch, from batch `start` on."""
        for index, batch in enumerate(self.order(epoch)):
            if index >= start:
                rng = np.random.default_rng([self.seed, epoch, index, self.rank])
                yield self.dataset.collate(batch[self.rank :: self.world], rng)


def _rows(corpus: Corpus, split: str, captioned: bool | None) -> np.ndarray:
    rows = corpus.rows(split, captioned)
    if not len(rows):
        kind = "captioned windows" if captioned else "windows"
        raise InputError(corpus.folder, split, f"split has no {kind}; add clips or change data.ratios or data.seed")
    return rows


def _weights(corpus: Corpus, rows: np.ndarray, groups: Mapping[str, float] | None) -> np.ndarray | None:
    """(entries,) draw probabilities, or None for every entry once."""
    if not groups:
        return None
    known = set(np.unique(corpus.clips.group))
    for name, value in groups.items():
        if name not in known:
            raise InputError("group_weights", name, f"must name one of the roots {', '.join(sorted(known))}")
        if not value > 0:
            raise InputError(f"group_weights.{name}", value, "must be positive")
    weights = np.array([groups.get(group, 1.0) for group in corpus.clips.group[rows]], dtype=np.float64)
    return weights / weights.sum()


def _encode(corpus: Corpus, max_words: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Word ids (captions, N), tag ids (captions, N) and counts (captions,) of every caption; equal texts once."""
    captions, vocabulary = corpus.captions, corpus.context.vocabulary
    words = np.full((len(captions), max_words + 2), PAD, dtype=np.int32)
    tags = np.zeros_like(words)
    counts = np.zeros(len(captions), dtype=np.int64)
    known: dict[tuple, tuple] = {}
    for i, sentence in enumerate(zip(captions.words, captions.tags, strict=True)):
        if sentence not in known:
            known[sentence] = vocabulary.encode(Sentence(captions.text[i], *sentence), max_words=max_words)
        ids, tag_ids = known[sentence]
        counts[i] = len(ids)
        words[i, : len(ids)], tags[i, : len(ids)] = ids, tag_ids
    return words, tags, counts


def _gather(values: np.ndarray, offset: np.ndarray, count: np.ndarray, length: int) -> np.ndarray:
    """(B, length, ...) stretches of `values` from `offset`, zero beyond `count`."""
    step = np.arange(length)
    # Padding re-reads the first frame of the stretch (always a valid index), then is zeroed.
    index = offset[:, None] + np.where(step < count[:, None], step, 0)
    out = values[index]
    out[step >= count[:, None]] = 0
    return out


def _labels(corpus: Corpus, rows: np.ndarray) -> dict[str, Tensor]:
    return {"style": _long(corpus.style_ids[rows]), "action": _long(corpus.action_ids[rows])}


def _long(values: np.ndarray) -> Tensor:
    return torch.from_numpy(np.asarray(values, dtype=np.int64))
