"""The words of a corpus's captions as indices: normalized as the papers have them, or as people wrote them."""

from __future__ import annotations

import numpy as np

from motionary.corpus.store import Corpus
from motionary.language import PAD, TAGS, Sentence, Vocabulary, as_written, written_vocabulary


def captions_vocabulary(corpus: Corpus) -> Vocabulary:
    """The words of the training captions as they were written."""
    rows = corpus.rows("train", captioned=True)
    return written_vocabulary(corpus.captions.text[np.isin(corpus.captions.clip, rows)])


def encode_captions(
    corpus: Corpus, max_words: int, written: Vocabulary | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Every caption of a corpus; equal texts are encoded once.

    Args:
        corpus: that holds the captions.
        max_words: longer ones are cut.
        written: a vocabulary of words as they were written; None takes normalized words and the corpus's vocabulary.

    Returns:
        Word ids (captions, N), ids of their classes (captions, N), and counts (captions,).
    """
    captions, vocabulary = corpus.captions, written or corpus.context.vocabulary
    words = np.full((len(captions), max_words + 2), PAD, dtype=np.int32)
    tags = np.full_like(words, TAGS.index("OTHER"))
    counts = np.zeros(len(captions), dtype=np.int64)
    known: dict[tuple, tuple] = {}
    for i, (text, *normal) in enumerate(zip(captions.text, captions.words, captions.tags, strict=True)):
        place = tuple(normal) if written is None else (text,)
        if place not in known:
            sentence = Sentence(text, *normal) if written is None else as_written(text)
            known[place] = vocabulary.encode(sentence, max_words=max_words)
        ids, tag_ids = known[place]
        counts[i] = len(ids)
        words[i, : len(ids)], tags[i, : len(ids)] = ids, tag_ids
    return words, tags, counts
