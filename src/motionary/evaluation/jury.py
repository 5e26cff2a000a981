"""Several judges at once: each scores every row, since one judge alone has been wrong about what it reads itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from motionary.evaluation.scores import Protocol, judged_parts
from motionary.language import Sentence
from motionary.metrics.retrieval import own_ranks, rank_correlation
from motionary.systems.protocols import TextMotionJudge

Features = Mapping[str, np.ndarray]  # (N, E) by each judge's name; E differs
Drawn = tuple[Features, Features, dict[str, np.ndarray]]  # texts, motions, parts


class Jury:
    """Judges by name. The first one's rows are the report's; the others' lie in them below "by" and the name.

    Args:
        judges: at least one.
        protocol: repetitions, pools and pairs.
    """

    def __init__(self, judges: Mapping[str, TextMotionJudge], protocol: Protocol):
        self.judges, self.protocol = dict(judges), protocol
        self.first = next(iter(self.judges))

    def motions(self, features: Sequence[np.ndarray]) -> Features:
        """What each judge makes of raw motion features, each (T, D)."""
        return {name: judge.motions(features) for name, judge in self.judges.items()}

    def sentences(self, sentences: Sequence[Sentence]) -> Features:
        """What each judge makes of sentences."""
        return {name: judge.sentences(sentences) for name, judge in self.judges.items()}

    def rows(self, draws: Sequence[Drawn], real: Features) -> dict[str, dict[str, Any]]:
        """`scores.judged_parts` by every judge: {part: {metric: interval, "by": {judge: {metric: interval}}}}."""
        found = {
            name: judged_parts(
                [(text[name], motion[name], parts) for text, motion, parts in draws], real[name], self.protocol
            )
            for name in self.judges
        }
        others = [name for name in self.judges if name != self.first]
        return {
            part: {**row, **({"by": {name: found[name][part] for name in others}} if others else {})}
            for part, row in found[self.first].items()
        }

    def agreement(self, text: Features, real: Features) -> dict[str, float]:
        """Spearman correlation of the first judge's ranks of real motions with each other judge's.

        A rank is the place of a text's own motion among all of the split's. It says whether the judges find the same
        motions hard to tell; both may be right and differ.
        """
        ranks = {name: own_ranks(text[name], real[name]) for name in self.judges}
        others = (name for name in self.judges if name != self.first)
        return {name: round(rank_correlation(ranks[self.first], ranks[name]), 4) for name in others}
