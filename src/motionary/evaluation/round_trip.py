"""Scores of a system that encodes motion and decodes it again: position errors, and the judge's view of the result."""

from __future__ import annotations

from typing import Any

from motionary.evaluation.confirmation import confirmed
from motionary.evaluation.items import Items, sentence_of
from motionary.evaluation.plausibility import plausibility
from motionary.evaluation.positions import position_report, unmirrored
from motionary.evaluation.scores import Protocol, judged_parts
from motionary.systems.codec import BatchedCodec
from motionary.systems.protocols import TextMotionJudge


def score_reconstructor(
    codec: BatchedCodec, items: Items, judge: TextMotionJudge, protocol: Protocol
) -> dict[str, Any]:
    """Report of real test motions passed through a system: what its codes lose.

    Args:
        codec: the system's.
        items: captioned test windows.
        judge: the evaluator.
        protocol: repetitions and sizes.
    """
    corpus = items.corpus
    rows = unmirrored(corpus, "test")
    decoded = codec.reconstruct([corpus.features(i) for i in rows])
    place = {row: i for i, row in enumerate(rows)}
    captions = items.choose(0)
    sentences, of_items = [sentence_of(corpus, c) for c in captions], [decoded[place[row]] for row in items.rows]
    text, motion = judge.sentences(sentences), judge.motions(of_items)
    real = judge.motions(items.features)
    parts = items.parts(captions)
    return {
        "positions": position_report(corpus, rows, decoded),
        "reconstruction": judged_parts([(text, motion, parts)], real, protocol),
        "reconstruction_oracle": confirmed(items, sentences, of_items, parts),
        "physics": {
            "reconstructed": plausibility(items, of_items),
            "real": plausibility(items, items.features),
        },
        "real": judged_parts([(text, real, parts)], real, protocol),
    }
