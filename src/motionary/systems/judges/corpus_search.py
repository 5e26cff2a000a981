"""Retrieval over the training motions: the dictionary's search, and the baselines that only copy.

A system like the others, so that the result table shows what copying is worth: text to the nearest training motion,
and motion to the caption of the nearest training motion, both in the evaluator's space.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.files import save_array, written_by
from motionary.language import Meanings, Sentence, as_written
from motionary.nn.neighbors import nearest
from motionary.systems.io import ROLES, roles
from motionary.systems.judges.judge import Judge
from motionary.systems.requests import check_frames, check_seeds


class Index:
    """Features of every window of a corpus in the evaluator's space.

    Attributes:
        motions: (N, E) float32, one row per window of the corpus.
        evaluator: hash of the evaluator that made them.
        judge: its name.
    """

    def __init__(self, motions: np.ndarray, evaluator: str, judge: str = "evaluator"):
        self.motions, self.evaluator, self.judge = motions, evaluator, judge

    def save(self, folder: Path) -> None:
        """Writes motions.npy and index.json."""
        folder.mkdir(parents=True, exist_ok=True)
        save_array(folder / "motions.npy", self.motions)
        about = {"evaluator": self.evaluator, "roles": {"evaluator": self.judge}}
        (folder / ROLES).write_text(json.dumps(about) + "\n")

    @classmethod
    def load(cls, folder: Path) -> Index:
        """Reads what :meth:`save` wrote."""
        if not (folder / ROLES).exists():
            raise InputError(folder, "missing", "run `dvc repro retrieval` first")
        with written_by("retrieval", folder / ROLES):
            about = json.loads((folder / ROLES).read_text())
            made_by = str(about["evaluator"]), roles(folder).get("evaluator", "evaluator")
        with written_by("retrieval", folder / "motions.npy"):
            motions = np.load(folder / "motions.npy", mmap_mode="r")
            return cls(motions if motions.dtype == np.float32 else motions.astype(np.float32), *made_by)

    def nearest(self, queries: np.ndarray, rows: np.ndarray, k: int = 1) -> np.ndarray:
        """(Q, k) of `rows`, nearest first, for (Q, E) query features."""
        return rows[nearest(queries, np.asarray(self.motions[rows]), k)]


def meanings_of(corpus: Corpus) -> Meanings:
    """What the words and captions of the training split mean, for words that are not among them."""
    rows = corpus.rows("train", captioned=True)
    said, captions = np.isin(corpus.captions.clip, rows[~corpus.added[rows]]), corpus.captions
    texts = zip(captions.text[said], captions.words[said], captions.tags[said], strict=True)
    distinct = {str(text): Sentence(str(text), tuple(words), tuple(tags)) for text, words, tags in texts}
    return Meanings.of(corpus.context.vocabulary, list(distinct.values()))


class Retrieval:
    """Answers by copying from the training split (and searches every split for the dictionary)."""

    takes_lengths = draws = False
    written = True
    sources: tuple[str, ...] = ()

    def __init__(self, corpus: Corpus, judge: Judge, index: Index):
        self.corpus, self.judge, self.index = corpus, judge, index
        self.context = self.corpus.context
        if index.evaluator != judge.hash:
            raise InputError("retrieval", index.evaluator, "belongs to another evaluator; run `dvc repro retrieval`")
        if len(index.motions) != len(self.corpus):
            rule = f"must have one row per window, {len(self.corpus)}"
            raise InputError("retrieval", len(index.motions), rule)
        self.training = self.corpus.rows("train", captioned=True)

    def generate(self, sentences: Sequence[Sentence], seeds: Sequence[int], frames=None, **options) -> list[np.ndarray]:
        """The training motion nearest to each text; where a text repeats, the next nearest.

        `frames` cuts the motion found; it is never made longer.
        """
        check_seeds(sentences, seeds)
        wanted = None if frames is None else check_frames(self.corpus.context, sentences, frames)
        if not sentences:
            return []
        texts = self.judge.sentences([self.corpus.context.vocabulary.correct(sentence) for sentence in sentences])
        found = self.index.nearest(texts, self.training, k=min(16, len(self.training)))
        seen: dict[tuple[str, ...], int] = {}
        motions = []
        for i, sentence in enumerate(sentences):
            place = seen.get(sentence.words, 0)
            seen[sentence.words] = place + 1
            features = np.array(self.corpus.features(found[i, place % found.shape[1]]))
            motions.append(features if wanted is None else features[: wanted[i]])
        return motions

    def caption(self, features: Sequence[np.ndarray], beams: int = 2, n: int = 1, **options) -> list[list[str]]:
        """The captions of the nearest training motions, in the words of :func:`as_written`."""
        found = self.index.nearest(self.judge.motions(features), self.training, k=n)
        return [
            [" ".join(as_written(str(self.corpus.captions.text[self.corpus.caption_start[row]])).words) for row in rows]
            for rows in found
        ]

    def search(self, sentences: Sequence[Sentence], k: int = 5) -> np.ndarray:
        """(N, k) rows of the corpus, without the mirrored copies that were added, nearest to each text first."""
        rows = np.flatnonzero(~self.corpus.added)
        return self.index.nearest(self.judge.sentences(sentences), rows, k=min(k, len(rows)))
