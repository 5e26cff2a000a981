"""Captions as they were written: inflected words, no lemmas."""

from __future__ import annotations

from collections.abc import Iterable

from motionary.language.annotate import Sentence
from motionary.language.text import is_word, tokenize
from motionary.language.vocabulary import Vocabulary


def as_written(text: str) -> Sentence:
    """The lower-case words of a text, contractions written out and punctuation left out; all of class OTHER."""
    words = tuple(token for token in tokenize(text) if is_word(token))
    return Sentence(text, words, ("OTHER",) * len(words))


def written_vocabulary(texts: Iterable[str], min_count: int = 1) -> Vocabulary:
    """The words of texts as they were written, those that occur at least `min_count` times."""
    return Vocabulary.build((as_written(text) for text in texts), min_count)
