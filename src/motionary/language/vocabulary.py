"""The words a model knows, and captions as their indices."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.language.annotate import Sentence
from motionary.language.lexicon import TAG_IDS, lexicon, tag_ids
from motionary.language.spelling import Speller
from motionary.language.text import with_words

PAD, START, END, UNKNOWN = range(4)
SPECIAL = ("<pad>", "<start>", "<end>", "<unknown>")
MAX_WORDS = 20  # of a caption, as in the released implementations


@dataclass(frozen=True)
class Vocabulary:
    """Words by index: PAD, START, END, UNKNOWN, then words from the most to the least frequent.

    Attributes:
        words: (V,) all words, the four special ones first.
        counts: (V,) occurrences in the sentences it was built from, 0 for the special ones.
    """

    words: tuple[str, ...]
    counts: tuple[int, ...]

    def __post_init__(self) -> None:
        if self.words[:4] != SPECIAL:
            raise InputError("vocabulary", self.words[:4], f"must begin with {' '.join(SPECIAL)}")
        if len(set(self.words)) != len(self.words) or len(self.counts) != len(self.words):
            raise InputError("vocabulary", len(self.words), "must have distinct words and one count for each")

    @classmethod
    def build(cls, sentences: Iterable[Sentence], min_count: int = 1) -> Vocabulary:
        """All words that occur at least ``min_count`` times; the order does not depend on that of the sentences."""
        if min_count < 1:
            raise InputError("min_count", min_count, "must be at least 1")
        counted = Counter(word for sentence in sentences for word in sentence.words if word not in SPECIAL)
        kept = sorted((-count, word) for word, count in counted.items() if count >= min_count)
        return cls((*SPECIAL, *(word for _, word in kept)), (0,) * 4 + tuple(-count for count, _ in kept))

    def __len__(self) -> int:
        return len(self.words)

    def __contains__(self, word: object) -> bool:
        return word in self.ids

    @cached_property
    def ids(self) -> dict[str, int]:
        """Word -> index."""
        return {word: index for index, word in enumerate(self.words)}

    def encode(self, sentence: Sentence, max_words: int = MAX_WORDS) -> tuple[np.ndarray, np.ndarray]:
        """Indices of the words and of their tags, each (2 + min(words, max_words),) int64.

        Both begin with START and close with END, whose tag is OTHER. Of a longer sentence the first ``max_words``
        words count. A word outside the vocabulary is UNKNOWN (see `correct`); an empty sentence is START END.
        """
        words = [self.ids.get(word, UNKNOWN) for word in sentence.words[:max_words]]
        other = TAG_IDS["OTHER"]
        tags = [other, *tag_ids(sentence.tags[:max_words]), other]
        return np.array([START, *words, END], dtype=np.int64), np.array(tags, dtype=np.int64)

    def encode_batch(
        self, sentences: Sequence[Sentence], max_words: int = MAX_WORDS
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Several sentences: ids (B, N) and tags (B, N), filled with PAD and OTHER, and counts (B,), all int64.

        N is the longest of the batch; a count includes START and END.
        """
        encoded = [self.encode(sentence, max_words) for sentence in sentences]
        counts = np.array([len(ids) for ids, _ in encoded], dtype=np.int64)
        shape = len(encoded), int(counts.max(initial=0))
        all_ids, all_tags = np.full(shape, PAD, dtype=np.int64), np.full(shape, TAG_IDS["OTHER"], dtype=np.int64)
        for row, (ids, tags) in enumerate(encoded):
            all_ids[row, : len(ids)], all_tags[row, : len(tags)] = ids, tags
        return all_ids, all_tags, counts

    def decode(self, ids: Iterable[int]) -> str:
        """The words up to the first END, joined by blanks; START and PAD are left out."""
        words = []
        for index in map(int, ids):
            if index == END:
                break
            if index not in (START, PAD):
                words.append(self.words[index])
        return " ".join(words)

    def correct(self, sentence: Sentence) -> Sentence:
        """Put known words in place of unknown ones: a related form, else the word a typo meant, else ``<unknown>``.

        Typos are at most two edits away (one in words of four or five letters) and no correct English words; of
        several candidates the nearest, then the most frequent in training wins. Tags follow the new words; an
        unknown word keeps its tag.
        """
        if all(word in self.ids for word in sentence.words):
            return sentence
        words = tuple(self.speller.nearest(word) or SPECIAL[UNKNOWN] for word in sentence.words)
        before = ("", *words)[: len(words)]
        tags = tuple(
            tag if new in (old, SPECIAL[UNKNOWN]) else lexicon().tag(new, tag, previous, default=tag)
            for new, old, tag, previous in zip(words, sentence.words, sentence.tags, before, strict=True)
        )
        return Sentence(sentence.text, words, tags)

    def mended(self, sentence: Sentence) -> str:
        """The text as a language model should read it: as written, but for typos of known words.

        TEMOS 4.5 found that a typo can spoil a motion, and asks for such a correction beforehand.
        """
        corrected = self.correct(sentence)
        if not sentence.text:
            return corrected.normalized
        pairs = zip(sentence.words, corrected.words, strict=True)
        return with_words(sentence.text, {old: new for old, new in pairs if new not in (old, SPECIAL[UNKNOWN])})

    @cached_property
    def speller(self) -> Speller:
        """Corrections over this vocabulary, indexed at the first use."""
        return Speller(dict(zip(self.words[4:], self.counts[4:], strict=True)))

    def to_json(self) -> dict[str, Any]:
        """Plain values for a config file: the words after the special ones, and their counts."""
        return {"words": list(self.words[4:]), "counts": list(self.counts[4:])}

    @classmethod
    def from_json(cls, value: Mapping[str, Any]) -> Vocabulary:
        """The inverse of `to_json`.

        Raises:
            InputError: fields are missing or do not fit together.
        """
        try:
            words, counts = [str(word) for word in value["words"]], [int(count) for count in value["counts"]]
        except (KeyError, TypeError, ValueError):
            raise InputError("vocabulary", value, "must have lists words and counts") from None
        return cls((*SPECIAL, *words), (0, 0, 0, 0, *counts))
