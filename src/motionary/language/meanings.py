"""What the words and captions of a corpus mean to the frozen language model, for words that it does not have."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from motionary.files import readable
from motionary.language.annotate import Sentence, annotate
from motionary.language.frozen import STATE_DIM, sentence_embeddings
from motionary.language.spelling import is_english
from motionary.language.vocabulary import Vocabulary

FILE = "meanings.npz"
NEAR = 0.35  # cosine of two words' vectors from which one may stand for the other
SELDOM = 2  # a word that captions have less often may be a typo, and stands for no other
# Words stand for words of a like class only.
_KINDS = (
    {"VERB", "ACTION"},
    {"NOUN", "OBJECT", "BODY_PART", "ACTION"},
    {"ADJ", "ADV", "DESCRIPTION"},
    {"LOCATION", "ADP", "ADV"},
    {"NUM"},
)


@dataclass(frozen=True, eq=False)
class Meanings:
    """Vectors of a corpus's words and training captions, rows of norm 1 of the packaged sentence model.

    Attributes:
        words: N words that may stand for others, by how often they occur.
        tags: the class that each has most often, one of `TAGS`.
        vectors: (N, 384) float32 of the words.
        captions: M different training captions, as written.
        caption_vectors: (M, 384) float32 of these.
    """

    words: tuple[str, ...]
    tags: tuple[str, ...]
    vectors: np.ndarray
    captions: tuple[str, ...] = ()
    caption_vectors: np.ndarray = field(default_factory=lambda: np.zeros((0, STATE_DIM), np.float32))

    @classmethod
    def of(cls, vocabulary: Vocabulary, captions: Sequence[Sentence]) -> Meanings:
        """Of a vocabulary and the training captions that it was built from."""
        texts = tuple(dict.fromkeys(sentence.text for sentence in captions))
        words, tags = _classed(vocabulary, captions)
        return cls(words, tags, sentence_embeddings(words), texts, sentence_embeddings(texts))

    @classmethod
    def of_words(cls, vocabulary: Vocabulary) -> Meanings:
        """Of a vocabulary alone, where its captions are not at hand: there is no distance to what was learned."""
        words, tags = _classed(vocabulary, annotate(vocabulary.words[4:]))
        return cls(words, tags, sentence_embeddings(words))

    def nearest(self, word: str, tag: str) -> str | None:
        """The word of a like class that means most nearly the same as an English word; None where none is near.

        Typos, which captions have too, stand for nothing.
        """
        likeness = self.vectors @ sentence_embeddings([word])[0]
        near = (int(row) for row in np.argsort(-likeness) if likeness[row] >= NEAR)
        alike = (row for row in near if _alike(tag, self.tags[row]))
        return next((self.words[row] for row in alike if is_english(self.words[row])), None)

    def distance(self, text: str) -> tuple[float, str] | None:
        """Cosine distance, in [0, 2], of a text to the nearest training caption, and that; None without captions."""
        if not self.captions:
            return None
        likeness = self.caption_vectors @ sentence_embeddings([text])[0]
        best = int(likeness.argmax())
        return max(0.0, 1.0 - float(likeness[best])), self.captions[best]

    def save(self, folder: Path) -> None:
        """Writes meanings.npz into a folder, vectors as rows of 8-bit integers."""
        folder.mkdir(parents=True, exist_ok=True)
        np.savez(
            folder / FILE,
            words=np.array(self.words),
            tags=np.array(self.tags),
            vectors=_small(self.vectors),
            captions=np.array(self.captions, dtype=np.str_),
            caption_vectors=_small(self.caption_vectors),
        )

    @classmethod
    def load(cls, folder: Path) -> Meanings:
        """Reads what :meth:`save` wrote."""
        with np.load(readable(folder / FILE), allow_pickle=False) as found:
            words, tags, captions = (tuple(map(str, found[name])) for name in ("words", "tags", "captions"))
            vectors, caption_vectors = (_unit(found[name]) for name in ("vectors", "caption_vectors"))
        return cls(words, tags, vectors, captions, caption_vectors)


def _small(rows: np.ndarray) -> np.ndarray:
    most = np.abs(rows).max(axis=1, keepdims=True, initial=1e-9)
    return np.round(rows / most * 127).astype(np.int8)


def _unit(rows: np.ndarray) -> np.ndarray:
    wide = rows.astype(np.float32)
    return wide / np.maximum(np.linalg.norm(wide, axis=1, keepdims=True), 1e-9)


def _classed(vocabulary: Vocabulary, sentences: Sequence[Sentence]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The vocabulary's words that may stand for others, and each one's most frequent class in the sentences."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for sentence in sentences:
        for word, tag in zip(sentence.words, sentence.tags, strict=True):
            counts[word][tag] += 1
    often = dict(zip(vocabulary.words, vocabulary.counts, strict=True))
    classed = {word: counts[word].most_common(1)[0][0] for word in often if counts[word] and often[word] >= SELDOM}
    kept = {word: tag for word, tag in classed.items() if any(tag in kind for kind in _KINDS)}
    return tuple(kept), tuple(kept.values())


def _alike(tag: str, other: str) -> bool:
    return any(tag in kind and other in kind for kind in _KINDS)
