"""How much of a captioner's BLEU is wording and how much is understanding: it is compared with a reader who knows the
style and the action of each window."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from motionary.corpus.store import Corpus
from motionary.evaluation.items import Items
from motionary.language.consensus import consensus
from motionary.metrics.captions import bleu_interval


def score_by_labels(
    captions: Sequence[str],
    references: Sequence[Sequence[str]],
    items: Items,
    known: Mapping[tuple[str, str], Counter[str]],
) -> dict[str, Any]:
    """Captions of windows with a style and an action, apart by whether training saw the two together.

    Where many wordings mean the same, even a reader who knows both labels cannot guess the one that a window got: the
    training caption that agrees best with all others for the same labels says how far such a reader comes.

    Args:
        captions: one normalized caption for each item.
        references: the normalized captions of each item.
        items: the test windows.
        known: training captions, from `captions_by_labels`.

    Returns:
        {"seen", "unseen"}, each {"items", "bleu4" of the captions}; "seen" also {"reader": BLEU-4 of the reader,
        "said": share of captions that training has for the same labels}. What has fewer than two windows is left out.
    """
    clips = items.corpus.clips
    labels = [(str(clips.style[row]), str(clips.action[row])) for row in items.rows]
    labeled = [i for i, pair in enumerate(labels) if all(pair)]

    def bleu4(texts: Sequence[str], where: Sequence[int]) -> dict[str, float]:
        """BLEU-4 with its interval."""
        return bleu_interval(texts, [references[i] for i in where])[3].report()

    report = {}
    for name, seen in (("seen", True), ("unseen", False)):
        where = [i for i in labeled if (labels[i] in known) == seen]
        if len(where) < 2:
            continue
        report[name] = {"items": len(where), "bleu4": bleu4([captions[i] for i in where], where)}
        if seen:
            agreed = {pair: _agreed(known[pair]) for pair in {labels[i] for i in where}}
            report[name]["reader"] = bleu4([agreed[labels[i]] for i in where], where)
            report[name]["said"] = round(float(np.mean([captions[i] in known[labels[i]] for i in where])), 4)
    return report


def _agreed(counts: Counter[str]) -> str:
    """The caption that agrees best with all of these."""
    return consensus(list(counts), list(counts.elements()))[0]


def captions_by_labels(corpus: Corpus) -> dict[tuple[str, str], Counter[str]]:
    """How often each normalized caption occurs in training, by style and action of its window."""
    found: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    for row in corpus.rows("train", captioned=True):
        labels = str(corpus.clips.style[row]), str(corpus.clips.action[row])
        found[labels].update(" ".join(corpus.captions.words[caption]) for caption in corpus.captions_of(row))
    return dict(found)
