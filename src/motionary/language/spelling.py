"""Unknown words: the known word that was probably meant."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache

from motionary.language.lexicon import lexicon

SHORTEST = 4  # letters; shorter words have too many neighbors
FARTHEST = 2  # edits

# Derivations that keep the sense well enough for a motion: (ending, what replaces it).
_ENDINGS = (
    *(("ily", "y"), ("ly", ""), ("ing", ""), ("ing", "e"), ("ed", ""), ("ed", "e"), ("es", ""), ("s", "")),
    *(("er", ""), ("er", "e"), ("est", ""), ("est", "e"), ("ward", "wards"), ("y", "ily"), ("", "ly"), ("", "ward")),
)


class Speller:
    """Finds the known word nearest to an unknown one.

    Args:
        counts: known words and how often they occur; among equally near words the most frequent wins.
    """

    def __init__(self, counts: Mapping[str, int]):
        self._counts = dict(counts)
        self._index = [(word, len(word), _letters(word)) for word in self._counts if len(word) >= SHORTEST - 1]
        self._answers: dict[str, str | None] = {}

    def nearest(self, word: str) -> str | None:
        """The known word for ``word``: itself, a known form of it, or within two edits; None where there is none.

        A correct English word is not a typo: "bake" does not become "take", it stays unknown.
        """
        if word in self._counts:
            return word
        if word not in self._answers:
            self._answers[word] = self._relative(word) or self._typo(word)
        return self._answers[word]

    def _relative(self, word: str) -> str | None:
        lemma = lexicon().lemma(word)
        if lemma in self._counts:
            return lemma
        for ending, replacement in _ENDINGS:
            stem = word[: len(word) - len(ending)]
            if not word.endswith(ending) or len(stem) < 3:
                continue
            for form in (stem, re.sub(r"([^aeiou])\1$", r"\1", stem)):  # "runner": runn, run
                if form + replacement in self._counts:
                    return form + replacement
        return None

    def _typo(self, word: str) -> str | None:
        if len(word) < SHORTEST or not word.isascii() or not word.isalpha() or is_english(word):
            return None
        # In five letters two edits leave too little of the word.
        farthest = FARTHEST if len(word) > SHORTEST + 1 else 1
        letters, best = _letters(word), (farthest + 1, 0, "")
        for known, length, known_letters in self._index:
            # Each edit changes at most two of the letter kinds, and at most one of the length.
            if abs(length - len(word)) > farthest or (letters ^ known_letters).bit_count() > 2 * farthest:
                continue
            found = (edit_distance(word, known), -self._counts[known], known)
            best = min(best, found)
        return best[2] or None


def edit_distance(a: str, b: str) -> int:
    """Insertions, deletions, substitutions and swaps of neighbors that turn one word into the other."""
    before: list[int] = []
    row = list(range(len(b) + 1))
    for i, letter in enumerate(a, 1):
        before, last, row = row, before, [i]
        for j, other in enumerate(b, 1):
            cost = min(before[j] + 1, row[j - 1] + 1, before[j - 1] + (letter != other))
            if i > 1 and j > 1 and letter == b[j - 2] and a[i - 2] == other:
                cost = min(cost, last[j - 2] + 1)
            row.append(cost)
    return row[-1]


def _letters(word: str) -> int:
    """The set of letters as bits."""
    bits = 0
    for letter in word:
        bits |= 1 << (ord(letter) & 31)
    return bits


def is_english(word: str) -> bool:
    """Whether a lower-case word stands in a list of English ones."""
    return word in _english()


@lru_cache(maxsize=1)
def _english():
    from spellchecker import SpellChecker

    return SpellChecker("en")
