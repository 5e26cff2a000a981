"""Batches of a dataset, resumable at any step."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from motionary.corpus.batch import Batch, Dataset
from motionary.corpus.datasets import Pairs, Windows
from motionary.corpus.token_store import TokenStore
from motionary.errors import InputError

__all__ = ["Batch", "Batches", "Dataset", "Pairs", "TokenStore", "Windows"]


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
                # From 1 on, since a seed that ends in zeros is the same without them: that of the order.
                rng = np.random.default_rng([self.seed, epoch, 1 + index, self.rank])
                yield self.dataset.collate(batch[self.rank :: self.world], rng)
