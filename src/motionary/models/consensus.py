"""The caption that agrees best with what the model would say: minimum Bayes risk (Kumar and Byrne, 2004)."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

ORDER = 4  # longest n-gram compared


def consensus(candidates: Sequence[str], samples: Sequence[str]) -> list[str]:
    """The distinct candidates, from the highest to the lowest mean agreement with `samples`.

    The samples stand for the model's distribution. Beam search gives its mode, which with many wordings of one meaning
    is often none that most people would use; this gives the wording that overlaps most with all of them.
    """
    weights = Counter(samples)
    references = [(_ngrams(text.split()), len(text.split()), weight) for text, weight in weights.items()]
    scored = []
    for text in dict.fromkeys(candidates):
        words = text.split()
        grams = _ngrams(words)
        scored.append((sum(weight * _agreement(grams, len(words), r, n) for r, n, weight in references), text))
    return [text for _, text in sorted(scored, key=lambda pair: -pair[0])]


def _ngrams(words: list[str]) -> list[Counter]:
    return [Counter(zip(*(words[i:] for i in range(n)), strict=False)) for n in range(1, ORDER + 1)]


def _agreement(candidate: list[Counter], length: int, reference: list[Counter], reference_length: int) -> float:
    """BLEU of one sentence, one added to matches and counts above single words (Lin and Och, 2004)."""
    total = 0.0
    for n, (own, other) in enumerate(zip(candidate, reference, strict=True)):
        matches, count = sum((own & other).values()), max(1, own.total())
        smooth = min(n, 1)
        total += math.log(max(matches + smooth, 1e-9) / (count + smooth))
    return math.exp(total / ORDER + min(0.0, 1 - reference_length / max(1, length)))
