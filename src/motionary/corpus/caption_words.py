"""The words of a corpus's captions as indices, normalized or as people wrote them, and whose words they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.language import PAD, TAGS, Sentence, Vocabulary, as_written, written_vocabulary


def captions_vocabulary(corpus: Corpus) -> Vocabulary:
    """The words of the training captions as they were written."""
    rows = corpus.rows("train", captioned=True)
    return written_vocabulary(corpus.captions.text[np.isin(corpus.captions.clip, rows)])


LEAST_SHARE = 0.01  # of the training captions: sources of fewer have too little to learn a wording from


def caption_sources(corpus: Corpus, first: str = "best") -> tuple[str, ...]:
    """The sources of training captions that have enough of them for a wording of their own.

    Args:
        corpus: that holds the captions.
        first: a source, or "best": that of the most training captions, each counted by its weight
            (`data.source_weights`), and of equal ones that of people. A wording that was learned of few motions has no
            words for the others.

    Returns:
        their names, `first` first, the others from the most to the least frequent; none where there is only one.

    Raises:
        InputError: `first` is none of them.
    """
    captions = corpus.captions
    train = np.isin(captions.clip, corpus.rows("train", captioned=True))
    names, start, counts = np.unique(captions.source[train].astype(str), return_index=True, return_counts=True)
    rank = sorted(range(len(names)), key=lambda i: -counts[i])
    kept = [i for i in rank if counts[i] >= LEAST_SHARE * train.sum()]
    human, weight = captions.human[train][start], captions.weight[train][start]
    sources = [str(names[i]) for i in kept]
    if first == "best":
        kept.sort(key=lambda i: (-weight[i] * counts[i], not human[i]))
        first = next((str(names[i]) for i in kept), first)
    elif first not in sources:
        raise InputError("motion2text.source", first, f"must be best, none or one of {', '.join(sources)}")
    return (first, *(name for name in sources if name != first)) if len(sources) > 1 else ()


def source_ids(corpus: Corpus, sources: Sequence[str]) -> np.ndarray:
    """(captions,) position of each caption's source in `sources`; that of the first for a source that is not there."""
    place = {name: i for i, name in enumerate(sources)}
    return np.array([place.get(name, 0) for name in corpus.captions.source], dtype=np.int64)


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
