"""Windows without captions among captioned ones, for models that can also do without a text."""

from __future__ import annotations

import numpy as np
import torch

from motionary.corpus.batch import Batch, Dataset
from motionary.corpus.datasets import Pairs, gather
from motionary.corpus.described import Described
from motionary.corpus.store import Corpus
from motionary.corpus.token_store import TokenStore
from motionary.language import TextStates


class WithUncaptioned:
    """Captioned windows with their tokens, a share of which is replaced by stretches of training windows that nobody
    captioned.

    Such a stretch is as long as what it replaces, or its whole window, and keeps the caption, which is to be left out:
    `textless` says where. A corpus without such windows changes nothing.

    Args:
        pairs: gives `tokens` and `token_count`.
        share: of the entries of each batch that are replaced, in the mean.
    """

    def __init__(self, pairs: Dataset, corpus: Corpus, tokens: TokenStore, share: float):
        self.pairs, self.tokens, self.share = pairs, tokens, share
        self.lengths, self.weights = pairs.lengths, pairs.weights
        rows = corpus.rows("train", False)
        self.counts = np.diff(tokens.offsets)
        self.rows = rows[self.counts[rows] > 0]
        # Long windows hold more that is new; each counts by its tokens.
        self.odds = self.counts[self.rows] / max(1, self.counts[self.rows].sum())

    def __len__(self) -> int:
        return len(self.pairs)

    def collate(self, indices: np.ndarray, rng: np.random.Generator) -> Batch:
        """The batch of `pairs`, some of its motions others, with `textless` (B,) bool."""
        batch = self.pairs.collate(indices, rng)
        replaced = (rng.random(len(indices)) < self.share) & (len(self.rows) > 0)
        batch.textless = torch.from_numpy(replaced)
        if replaced.any():
            rows = self.rows[rng.choice(len(self.rows), int(replaced.sum()), p=self.odds)]
            count = np.minimum(batch.token_count.numpy()[replaced], self.counts[rows])
            start = self.tokens.offsets[rows] + rng.integers(0, self.counts[rows] - count + 1)
            drawn = gather(self.tokens.tokens, start, count, batch.tokens.shape[1])
            batch.tokens[batch.textless] = torch.from_numpy(drawn).to(batch.tokens.dtype)
            batch.token_count[batch.textless] = torch.from_numpy(count)
            batch.clip[batch.textless] = torch.from_numpy(rows)
        return batch


def captioned_codes(
    corpus: Corpus,
    codes: TokenStore,
    states: TextStates,
    every_caption: bool,
    drop_unit: float,
    uncaptioned: float,
    motion: bool = False,
) -> tuple[WithUncaptioned, Described]:
    """What a generator of codes trains on and is validated by: captions with the language model's states, and codes.

    Args:
        codes: of every window of the corpus.
        every_caption: draw any caption of a window, and units to drop; else its first, and the whole window.
        drop_unit: see :class:`Pairs`.
        uncaptioned: share of the draws that are windows without captions.
        motion: also give the features of the captioned windows, those whose codes were replaced included.
    """
    pairs = Pairs(corpus, "train", codes, motion=motion, random=every_caption, drop_unit=drop_unit)
    held = Pairs(corpus, "val", codes, motion=motion, all_captions=True)
    return WithUncaptioned(Described(pairs, states), corpus, codes, uncaptioned), Described(held, states, raw=True)
