"""Scores of a system that encodes motion and decodes it again: position errors, and the judge's view of the result."""

from __future__ import annotations

from typing import Any

from motionary.evaluation.confirmation import confirmed
from motionary.evaluation.items import Items, sentence_of
from motionary.evaluation.jury import Jury
from motionary.evaluation.plausibility import plausibility
from motionary.evaluation.positions import position_report, unmirrored
from motionary.systems.codec import BatchedCodec


def score_reconstructor(codec: BatchedCodec, items: Items, jury: Jury) -> dict[str, Any]:
    """Report of real test motions passed through a system: what its codes lose.

    Args:
        codec: the system's.
        items: captioned test windows.
        jury: the judges.
    """
    corpus = items.corpus
    rows = unmirrored(corpus, "test")
    decoded = codec.reconstruct([corpus.features(i) for i in rows])
    place = {row: i for i, row in enumerate(rows)}
    captions = items.choose(0)
    sentences, of_items = [sentence_of(corpus, c) for c in captions], [decoded[place[row]] for row in items.rows]
    text, motion = jury.sentences(sentences), jury.motions(of_items)
    real = jury.motions(items.features)
    parts = items.parts(captions)
    return {
        "positions": position_report(corpus, rows, decoded),
        "reconstruction": jury.rows([(text, motion, parts)], real),
        "reconstruction_oracle": confirmed(items, sentences, of_items, parts),
        "physics": {
            "reconstructed": plausibility(items, of_items),
            "real": plausibility(items, items.features),
        },
        "real": jury.rows([(text, real, parts)], real),
    }
