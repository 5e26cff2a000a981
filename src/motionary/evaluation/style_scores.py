"""Scores of stylization by the thesis's protocol (5.3): every way to use it, with a floor and a ceiling beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from tqdm import tqdm

from motionary.corpus.cells import StyleSplit
from motionary.corpus.store import Corpus
from motionary.errors import MOST, InputError
from motionary.evaluation.scores import summarize
from motionary.evaluation.style_draws import HELD_OUT, TARGETS, TEST, Draw, Drawer, pools
from motionary.evaluation.style_measures import Measured, Measures, local_rotations, scored, spread, turned
from motionary.systems.protocols import StyleClassifier


@dataclass(frozen=True)
class StyleProtocol:
    """Settings of the evaluation (conf/style_evaluation.yaml documents each)."""

    repetitions: int = 30
    contents: int = 64
    diversity_contents: int = 8
    diversity_samples: int = 4
    pose_step: int = 8
    codes: int = 400

    def __post_init__(self):
        for name, value in vars(self).items():
            least = 2 if name in ("contents", "diversity_samples") else 1
            if not least <= value <= MOST:
                raise InputError(f"style_evaluation.{name}", value, f"must be in {least}..{MOST}")


@dataclass(frozen=True)
class Way:
    """One way to use stylization (thesis Fig. 5.3): what it is told of the wanted style."""

    name: str
    setting: str
    label: bool
    reference: bool

    @property
    def targeted(self) -> bool:
        """Whether it is told any style."""
        return self.label or self.reference


WAYS = (
    Way("motion-based (S)", "supervised", True, True),
    Way("label-based (S)", "supervised", True, False),
    Way("motion-based (U)", "unsupervised", False, True),
    Way("prior-based (U)", "unsupervised", False, False),
)
REAL, COPY, STYLE, CELL = "real motions", "copied content", "copied style motion", "real motion of the target cell"
COPIED_ROOT = "without global motion prediction"
PLANTED = "{}, feet planted"
_PLANTED_REPETITIONS = 3  # of motions with feet that stand, which take longer to make than to stylize


def score_stylization(
    stylizer: Any,
    judge: StyleClassifier,
    corpus: Corpus,
    split: StyleSplit,
    protocol: StyleProtocol,
    settings: Sequence[str],
    seed: int = 0,
) -> dict[str, Any]:
    """Rows of Tables 5.2, 5.3 and 5.7.

    Args:
        stylizer: offers ``stylize(contents, setting, labels, references, seeds, predict_root)`` and `receptive`.
        judge: the style and content classifiers.
        corpus: with held-out motions.
        split: the held-out cells of style and action.
        protocol: repetitions and counts.
        settings: trained ones, "supervised" and "unsupervised" or one of them.
        seed: of the draws.

    Returns:
        {part: {"items", "pool", "rows": {row: {metric: interval}}}} for each part of `style_draws.pools` that has
        motions; without scored styles there are no accuracies of style.
    """
    scorer, found = _Scorer(stylizer, judge, corpus, split, protocol, settings, seed), {}
    for name, pool in pools(corpus, split).items():
        drawer = Drawer(corpus, split, pool, stylizer.receptive, name == TARGETS) if len(pool) else None
        if drawer is not None and len(drawer.pool) >= 2:
            found[name] = scorer.run(drawer, name, copied_root=name in (HELD_OUT, TEST))
    if not found:
        raise InputError("style_evaluation", "no content", "needs two held-out motions or two of the test split")
    return found


class _Scorer:
    """Repetitions over pools of contents; real motions are measured once for all."""

    def __init__(self, stylizer, judge, corpus, split, protocol, settings, seed):
        self.stylizer, self.corpus, self.split, self.protocol, self.seed = stylizer, corpus, split, protocol, seed
        self.measures = Measures(judge, corpus)
        self.ways = [way for way in WAYS if way.setting in settings and (split.scored or not way.label)]

    def run(self, drawer: Drawer, name: str, copied_root: bool) -> dict[str, Any]:
        """All rows for the drawer's contents; `copied_root` adds the ablation of the global motion predictor."""
        rows: dict[str, list[dict[str, float]]] = {}
        for repetition in tqdm(range(self.protocol.repetitions), desc=name, unit="repetition"):
            draw = drawer.draw(repetition, self.protocol.contents, self.seed)
            for row, values in self._repetition(draw, copied_root, repetition < _PLANTED_REPETITIONS).items():
                rows.setdefault(row, []).append(values)
        count = min(self.protocol.contents, len(drawer.pool))
        return {
            "items": count,
            "pool": len(drawer.pool),
            "rows": {row: _summary(values) for row, values in rows.items()},
        }

    def _repetition(self, draw: Draw, copied_root: bool, planted: bool) -> dict[str, dict[str, float]]:
        corpus, step = self.corpus, self.protocol.pose_step
        features = [corpus.features(i) for i in draw.contents]
        rotations = local_rotations(features, corpus.context, step)
        content, style = self.measures.real(draw.contents), self.measures.real(draw.references)
        rows = self._fixed(draw, content, style)
        rows[COPY]["geodesic"] = float(turned(rotations, rotations).mean())
        for way in self.ways:
            for predict in (True, False) if copied_root and way.reference else (True,):
                made = self._stylize(way, draw, features, predict)
                values = scored(self.measures.of(made), content, style, draw, self.split, way.targeted)
                values["geodesic"] = float(turned(local_rotations(made, corpus.context, step), rotations).mean())
                if not way.reference:
                    values |= self._diversity(way, draw, features)
                rows[way.name if predict else f"{way.name} {COPIED_ROOT}"] = values
                if planted and predict:
                    found = self.measures.planted(made)
                    rows[PLANTED.format(way.name)] = scored(found, content, style, draw, self.split, way.targeted)
        return rows

    def _fixed(self, draw: Draw, content: Measured, style: Measured) -> dict[str, dict[str, float]]:
        """Real motions by their own labels, the copied content (floor of style, ceiling of content), the copied style
        motion (the reverse), and real motions that are what was asked for (ceiling of both)."""
        styles = self.corpus.style_ids[draw.contents]
        own = replace(draw, targets=styles)
        labeled = bool((own.targets >= 0).all()) and bool(self.split.scored)
        # Two halves of all real contents drawn: the least distance that can be told apart with so few.
        half = (len(draw.contents) + len(draw.others)) // 2
        second = self.measures.real(np.concatenate([draw.contents, draw.others])[half:])
        rows = {REAL: {}}
        if half >= 2:
            rows[REAL] = scored(
                content.take(np.arange(half)), second, second, own.take(np.arange(half)), self.split, labeled
            )
        rows[REAL] |= scored(content, None, None, own, self.split, labeled)
        rows[COPY] = scored(content, content, style, draw, self.split, True)
        if self.split.scored:
            rows[STYLE] = scored(style, content, None, draw, self.split, True)
        there = np.flatnonzero(draw.cells >= 0)
        if len(there) >= 2:
            found = self.measures.real(draw.cells[there])
            rows[CELL] = scored(found, content, style, draw.take(there), self.split, True)
        return rows

    def _stylize(self, way: Way, draw: Draw, features: list[np.ndarray], predict: bool) -> list[np.ndarray]:
        references = [self.corpus.features(i) for i in draw.references]
        return self.stylizer.stylize(
            features,
            setting=way.setting,
            labels=draw.targets.tolist() if way.label else None,
            references=references if way.reference else None,
            seeds=draw.seeds.tolist(),
            predict_root=predict,
        )

    def _diversity(self, way: Way, draw: Draw, features: list[np.ndarray]) -> dict[str, float]:
        """Mean distance in the style classifier's features of two stylizations of one content (thesis Eq. 3.20)."""
        count = min(self.protocol.diversity_contents, len(features))
        samples = self.protocol.diversity_samples
        if not self.measures.judge.trained:
            return {}
        made = self.stylizer.stylize(
            [features[i] for i in range(count) for _ in range(samples)],
            setting=way.setting,
            labels=draw.targets[:count].repeat(samples).tolist() if way.label else None,
            seeds=[int(draw.seeds[i]) + 7919 * (k + 1) for i in range(count) for k in range(samples)],
        )
        embedded = self.measures.judge.style(made)[1].reshape(count, samples, -1)
        return {"diversity": spread(embedded)}


def _summary(values: list[dict[str, float]]) -> dict[str, dict[str, float]]:
    """Mean and 95% interval of each metric over the repetitions that have it."""
    names = dict.fromkeys(name for row in values for name in row)
    return {name: summarize([{name: row[name]} for row in values if name in row])[name] for name in names}
