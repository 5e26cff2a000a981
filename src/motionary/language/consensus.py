"""The caption that agrees best with what the model would say: minimum Bayes risk (Kumar and Byrne, 2004)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

ORDER = 4  # longest n-gram compared


def consensus(candidates: Sequence[str], samples: Sequence[str]) -> list[str]:
    """The distinct candidates, from the highest to the lowest mean agreement with `samples`.

    The samples stand for the model's distribution. Beam search gives its mode, which with many wordings of one meaning
    is often none that most people would use; this gives the wording that overlaps most with all of them.
    """
    texts, weights = list(dict.fromkeys(candidates)), Counter(samples)
    mean = agreement(texts, list(weights)) @ np.array(list(weights.values())) / max(1, len(samples))
    # Rounded, so that equals stay in the order they came in.
    return [texts[i] for i in np.argsort(-mean.round(9), kind="stable")]


def agreement(candidates: Sequence[str], references: Sequence[str]) -> np.ndarray:
    """(C, R) BLEU of each candidate by each reference, one sentence each: one is added to matches and counts above
    single words (Lin and Och, 2004)."""
    ours, theirs = ([text.split() for text in texts] for texts in (candidates, references))
    length, other = (np.array([len(words) for words in texts], dtype=float) for texts in (ours, theirs))
    total = np.zeros((len(ours), len(theirs)))
    for n in range(1, ORDER + 1):
        smooth = min(n - 1, 1)
        counts = np.maximum(1, length - n + 1)
        matches = _matches([_ngrams(words, n) for words in ours], [_ngrams(words, n) for words in theirs])
        total += np.log(np.maximum(matches + smooth, 1e-9) / (counts + smooth)[:, None])
    return np.exp(total / ORDER + np.minimum(0, 1 - other / np.maximum(1, length)[:, None]))


def _ngrams(words: list[str], n: int) -> Counter[tuple[str, ...]]:
    return Counter(zip(*(words[i:] for i in range(n)), strict=False))


def _matches(ours: Sequence[Counter], theirs: Sequence[Counter]) -> np.ndarray:
    """(C, R) n-grams that two texts share, each as often as both have it."""
    columns = {gram: i for i, gram in enumerate(dict.fromkeys(gram for text in (*ours, *theirs) for gram in text))}
    first, second = (_table(texts, columns) for texts in (ours, theirs))
    matches = np.zeros((len(ours), len(theirs)))
    # min(a, b) is the number of k with a >= k and b >= k, which makes it a few matrix products.
    for k in range(1, int(min(first.max(initial=0), second.max(initial=0))) + 1):
        matches += (first >= k).astype(np.float32) @ (second >= k).astype(np.float32).T
    return matches


def _table(texts: Sequence[Counter], columns: dict[tuple[str, ...], int]) -> np.ndarray:
    """How often each text has each n-gram: (texts, n-grams)."""
    table = np.zeros((len(texts), len(columns)), dtype=np.float32)
    for row, text in zip(table, texts, strict=True):
        for gram, count in text.items():
            row[columns[gram]] = count
    return table
