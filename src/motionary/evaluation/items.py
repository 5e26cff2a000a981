"""The test items of a corpus, and the parts of them that every table reports separately."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.language import Sentence
from motionary.motion import Motion


class Items:
    """Captioned windows of a split, without the mirrored copies that preprocess added.

    Attributes:
        rows: (N,) rows of the corpus.
        features: raw features (T_i, D) of each.
        references: all captions of each, as sentences.
    """

    def __init__(self, corpus: Corpus, split: str = "test"):
        rows = corpus.rows(split, captioned=True)
        self.rows = rows[~corpus.added[rows]]
        if len(self.rows) < 2:
            raise InputError(f"{split} split", len(self.rows), "needs at least 2 captioned windows to evaluate")
        self.corpus = corpus
        self.features = [corpus.features(i) for i in self.rows]
        self.captions = [np.asarray(corpus.captions_of(i)) for i in self.rows]
        self.references = [[sentence_of(corpus, c) for c in captions] for captions in self.captions]

    def __len__(self) -> int:
        return len(self.rows)

    def motions(self, features: Sequence[np.ndarray]) -> list[Motion]:
        """Raw features (T, D) as motions of the corpus's skeleton and rate."""
        codec, fps = self.corpus.context.make_codec(), self.corpus.context.fps
        return [codec.decode(f, fps=fps) for f in features]

    def choose(self, draw: int) -> np.ndarray:
        """(N,) one caption row for each item, drawn by number `draw`."""
        rng = np.random.default_rng([draw, 11])
        return np.array([rng.choice(captions) for captions in self.captions])

    def parts(self, captions: np.ndarray) -> dict[str, np.ndarray]:
        """Positions of the items in each part: all, every root, and human-written against template captions.

        Parts of fewer than two items are left out; with a single root or a single kind of caption the part says
        nothing new and is left out too.
        """
        parts = {"all": np.arange(len(self))}
        groups = self.corpus.clips.group[self.rows]
        human = self.corpus.captions.human[captions].astype(bool)
        if len(np.unique(groups)) > 1:
            parts |= {str(group): np.flatnonzero(groups == group) for group in np.unique(groups)}
        if human.any() and not human.all():
            parts |= {"human captions": np.flatnonzero(human), "template captions": np.flatnonzero(~human)}
        return {name: positions for name, positions in parts.items() if len(positions) >= 2}


def sentence_of(corpus: Corpus, caption: int) -> Sentence:
    """Caption row `caption` as an annotated sentence."""
    captions = corpus.captions
    return Sentence(captions.text[caption], tuple(captions.words[caption]), tuple(captions.tags[caption]))
