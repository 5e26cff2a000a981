"""Scores of motions made of action labels by the thesis's protocol (3.3.1), real motions beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from tqdm import tqdm

from motionary.corpus.acted import Acted, ActionLabels
from motionary.corpus.encoding import planted
from motionary.corpus.store import Corpus
from motionary.errors import check_range
from motionary.evaluation.action_measures import REAL, TRAINING, Judged, real_values, values_of
from motionary.evaluation.real_actions import joints_of
from motionary.evaluation.scores import summarize
from motionary.metrics.physics import MEASURES, physics
from motionary.motion import Motion
from motionary.systems.action_protocols import ActionClassifier, ActionToMotion

LOCOMOTION = ("walk", "run", "jump")  # actions of Table 3.6, where a corpus has them


@dataclass(frozen=True)
class ActionProtocol:
    """Settings of the evaluation (conf/action_evaluation.yaml documents each)."""

    repetitions: int = 20
    samples: int = 3000
    diversity_pairs: int = 200
    multimodality_pairs: int = 20
    locomotion_samples: int = 500
    physics_motions: int = 64

    def __post_init__(self) -> None:
        check_range("action_evaluation", self, ("repetitions",), 1, 1000)
        check_range("action_evaluation", self, ("samples", "locomotion_samples"), 2, 100_000)
        check_range(
            "action_evaluation", self, ("diversity_pairs", "multimodality_pairs", "physics_motions"), 1, 100_000
        )


def score_actions(
    actor: ActionToMotion,
    judge: ActionClassifier,
    corpus: Corpus,
    labels: ActionLabels,
    protocol: ActionProtocol,
    window: int,
    seed: int = 0,
) -> dict[str, Any]:
    """Rows of Tables 3.2, 3.3 and 3.6.

    Generated motions take labels and lengths of real test motions, drawn anew in each repetition. FID is the distance
    to the real test motions; that of real motions is the distance of two halves of them, that of training motions what
    a perfect copy of the training set would reach.

    Returns:
        "coarse" and "fine", {"items", "rows": {row: {metric: interval}}}; "locomotion", the same for each action;
        "physics", {row: {measure: mean}}; kinds that cannot be scored are left out.
    """
    scorer, found = _Scorer(actor, judge, corpus, labels, protocol, window, seed), {}
    for kind in ("coarse", "fine"):
        part = scorer.kind(kind)
        if part is not None:
            found[kind] = part
    found["locomotion"] = scorer.locomotion()
    found["physics"] = scorer.physics()
    return found


class _Scorer:
    def __init__(self, actor, judge, corpus, labels, protocol, window, seed):
        self.actor, self.judge, self.corpus, self.labels = actor, judge, corpus, labels
        self.protocol, self.window, self.seed = protocol, window, seed
        self.known = {"coarse": labels.coarse, "fine": labels.fine}

    def kind(self, kind: str) -> dict[str, Any] | None:
        """All rows of one kind of labels."""
        test = self._real(kind, "test")
        variants = [v for v in self.actor.variants if tuple(self.actor.labels_of(v)) == self.known[kind]]
        if kind not in self.judge.labels or not variants or len(test.joints) < 4:
            return None
        train = self._real(kind, "train")
        rows: dict[str, list[dict[str, float]]] = {}
        for repetition in tqdm(range(self.protocol.repetitions), desc=f"{kind} actions", unit="repetition"):
            rng = np.random.default_rng([self.seed, repetition])
            rows.setdefault(REAL, []).append(real_values(test, self.protocol, rng))
            picked = train.take(rng.choice(len(train.joints), min(self.protocol.samples, len(train.joints)), False))
            rows.setdefault(TRAINING, []).append(values_of(picked, test, self.protocol, rng))
            for variant in variants:
                made = self._made(variant, kind, test, self.protocol.samples, rng)
                rows.setdefault(variant, []).append(values_of(made, test, self.protocol, rng))
        return {"items": len(test.joints), "rows": {row: summarize(values) for row, values in rows.items()}}

    def locomotion(self) -> dict[str, Any]:
        """Table 3.6: rows for walking, and for jumping or running, with foot skating; real motions of all splits."""
        if "coarse" not in self.judge.labels:
            return {}
        every, found = self._real("coarse", "train", "val", "test"), {}
        for action in [name for name in LOCOMOTION if name in self.known["coarse"]][:2]:
            real = every.take(np.flatnonzero(every.ids == self.known["coarse"].index(action)))
            if len(real.joints) < 4:
                continue
            rows: dict[str, list[dict[str, float]]] = {}
            for repetition in range(self.protocol.repetitions):
                rng = np.random.default_rng([self.seed, repetition, 1])
                rows.setdefault(REAL, []).append(real_values(real, self.protocol, rng) | self._skating(real))
                for variant in self.actor.variants:
                    if tuple(self.actor.labels_of(variant)) == self.known["coarse"]:
                        made = self._made(variant, "coarse", real, self.protocol.locomotion_samples, rng)
                        values = values_of(made, real, self.protocol, rng) | self._skating(made)
                        rows.setdefault(variant, []).append(values)
            found[action] = {"items": len(real.joints), "rows": {row: summarize(v) for row, v in rows.items()}}
        return found

    def physics(self) -> dict[str, dict[str, float]]:
        """Means of the physical measures of real test motions and of every variant's, as made and with feet planted."""
        test = self._real("coarse", "test")
        rng = np.random.default_rng([self.seed, 2])
        rows = {REAL: test.joints[: self.protocol.physics_motions]}
        for variant in self.actor.variants:
            kind = "coarse" if tuple(self.actor.labels_of(variant)) == self.known["coarse"] else "fine"
            base = test if kind == "coarse" else self._real(kind, "test")
            if len(base.joints):
                rows[variant] = self._motions(variant, kind, base, self.protocol.physics_motions, rng)[0]
        found = {}
        for row, motions in ((row, [self._motion(j) for j in joints if len(j) >= 4]) for row, joints in rows.items()):
            if motions:
                found[row] = self._measured(motions)
            if motions and row != REAL:
                found[f"{row}, feet planted"] = self._measured(planted(motions))
        return found

    def _measured(self, motions: Sequence[Motion]) -> dict[str, float]:
        found = [physics(motion) for motion in motions]
        return {name: round(float(np.mean([row[name] for row in found])), 6) for name in MEASURES}

    def _skating(self, made: Judged) -> dict[str, float]:
        chosen = [self._motion(j) for j in made.joints[: self.protocol.physics_motions] if len(j) >= 2]
        return {"foot_skating": float(np.mean([MEASURES["foot_skating"](motion) for motion in chosen]))}

    def _motion(self, joints: np.ndarray) -> Motion:
        return Motion(joints, self.corpus.context.fps, self.corpus.context.skeleton)

    def _real(self, kind: str, *splits: str) -> Judged:
        """Unmirrored real motions of some splits with a label of a kind, judged where it can be."""
        rows = np.concatenate([self.labels.rows(self.corpus, split, mirrored=False) for split in splits])
        rows = rows[(self.labels.action if kind == "coarse" else self.labels.fine_ids)[rows] >= 0]
        data = Acted(self.corpus, self.labels, rows, self.window, random=False)
        return self._judged(joints_of(data) if len(rows) else [], data.action if kind == "coarse" else data.fine, kind)

    def _made(self, variant: str, kind: str, real: Judged, count: int, rng: np.random.Generator) -> Judged:
        return self._judged(*self._motions(variant, kind, real, count, rng), kind)

    def _motions(
        self, variant: str, kind: str, real: Judged, count: int, rng: np.random.Generator
    ) -> tuple[list[np.ndarray], np.ndarray]:
        """`count` motions of a variant with labels and lengths of real ones, and their labels; the baseline starts from
        the real one's first pose."""
        drawn = rng.choice(len(real.joints), count)
        starts = [real.joints[i][:1] for i in drawn] if self.actor.starts_from_pose(variant) else None
        given = 0 if starts is None else 1
        plans = [[(self.known[kind][real.ids[i]], max(1, len(real.joints[i]) - given))] for i in drawn]
        seeds = rng.integers(2**31, size=count).tolist()
        made = self.actor.act(plans, seeds, starts=starts, variant=variant)
        return [motion.positions for motion in made], real.ids[drawn]

    def _judged(self, joints: list[np.ndarray], ids: np.ndarray, kind: str) -> Judged:
        if kind not in self.judge.labels or not joints:
            return Judged(joints, ids, np.zeros(len(ids), int), np.zeros((len(ids), 1)))
        logits, features = self.judge.judge(joints, kind)
        return Judged(joints, ids, logits.argmax(1), features)
