"""Word vectors to start a text encoder from."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from motionary.errors import InputError
from motionary.language.frozen import sentence_embeddings
from motionary.language.vocabulary import END, PAD, START, UNKNOWN, Vocabulary

SPREAD = 0.4  # root mean square of an entry, about that of GloVe's 300-d vectors


def word_vectors(vocabulary: Vocabulary, source: str | Path = "auto") -> np.ndarray | None:
    """One vector for each word of the vocabulary.

    Args:
        vocabulary: of V words.
        source: a GloVe text file (``word v1 ... vd`` a line; TM2T appendix B uses 300-d GloVe); "language_model",
            the packaged language model's embedding of each single word; "learned", nothing to start from; "auto",
            the language model.

    Returns:
        (V, d) float32, or None for "learned". PAD is zero. START, END and words that a file lacks are far from every
        word: fixed random directions of the words' mean length for the two, the mean of the words for UNKNOWN and
        for missing words.

    Raises:
        InputError: no such file, or one that is no table of word vectors, or without any word of the vocabulary.
    """
    if str(source) == "learned":
        return None
    if str(source) in ("auto", "language_model"):
        words = _scaled(sentence_embeddings(vocabulary.words[4:]))
        found = np.ones(len(words), dtype=bool)
    else:
        words, found = _read(Path(source), vocabulary)
    return _with_special(words, found)


def _with_special(words: np.ndarray, found: np.ndarray) -> np.ndarray:
    width = words.shape[1]
    vectors = np.zeros((4 + len(words), width), dtype=np.float32)
    vectors[4:] = words
    mean = words[found].mean(axis=0) if found.any() else np.zeros(width, dtype=np.float32)
    length = np.linalg.norm(words[found], axis=1).mean() if found.any() else 1.0
    directions = np.random.default_rng(0).standard_normal((2, width))
    vectors[[START, END]] = length * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    vectors[UNKNOWN] = mean
    vectors[4:][~found] = mean
    vectors[PAD] = 0
    return vectors


def _scaled(rows: np.ndarray) -> np.ndarray:
    """Unit rows to the size of GloVe's vectors, for which the papers' learning rates were chosen."""
    return rows * np.float32(SPREAD * np.sqrt(rows.shape[1]))


def _read(path: Path, vocabulary: Vocabulary) -> tuple[np.ndarray, np.ndarray]:
    """Vectors (V - 4, d) and which of them the file has; only the vocabulary's lines are parsed."""
    if not path.is_file():
        raise InputError("word vectors", path, "must be 'auto', 'language_model', 'learned' or a GloVe text file")
    wanted = {word: index for index, word in enumerate(vocabulary.words[4:])}
    rows: dict[int, np.ndarray] = {}
    with path.open(encoding="utf-8", errors="replace") as lines:
        for number, line in enumerate(lines, 1):
            word, _, numbers = line.rstrip().partition(" ")
            index = wanted.get(word)
            if index is None or index in rows:
                continue
            try:
                rows[index] = np.array(numbers.split(), dtype=np.float32)
            except ValueError:
                raise InputError(f"{path}, line {number}", line[:60], "must be a word and its numbers") from None
            if not rows[index].size or not np.isfinite(rows[index]).all():
                raise InputError(f"{path}, line {number}", line[:60], "must be a word and its finite numbers")
    widths = {row.size for row in rows.values()}
    if len(widths) != 1:
        rule = "must hold words of the vocabulary" if not widths else "must have as many numbers in each line"
        raise InputError("word vectors", path, rule)
    words, found = np.zeros((len(wanted), widths.pop()), dtype=np.float32), np.zeros(len(wanted), dtype=bool)
    for index, row in rows.items():
        words[index], found[index] = row, True
    return words, found
