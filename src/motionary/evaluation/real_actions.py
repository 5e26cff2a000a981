"""What a classifier says of real motions; apart from the scores of generated ones, which train no classifier anew."""

from __future__ import annotations

import numpy as np

from motionary.corpus.acted import Acted, ActionLabels
from motionary.corpus.store import Corpus
from motionary.metrics.classification import accuracy, macro_accuracy
from motionary.systems.action_protocols import ActionClassifier


def judge_real_actions(
    judge: ActionClassifier, corpus: Corpus, labels: ActionLabels, window: int
) -> dict[str, dict[str, float]]:
    """Accuracies on real test windows, over all and as the mean of classes, of each classifier that was trained."""
    rows, found = labels.rows(corpus, "test", mirrored=False), {}
    for kind, ids in (("coarse", labels.action[rows]), ("fine", labels.fine_ids[rows])):
        known = ids >= 0
        if kind in judge.labels and known.any():
            said = judge.judge(joints_of(Acted(corpus, labels, rows[known], window, random=False)), kind)[0].argmax(1)
            both = accuracy(said, ids[known]), macro_accuracy(said, ids[known])
            found[kind] = {"windows": int(known.sum()), "accuracy": round(both[0], 4), "macro": round(both[1], 4)}
    return found


def joints_of(data: Acted) -> list[np.ndarray]:
    """The middle stretch of every entry, (T, J, 3)."""
    batch = data.collate(np.arange(len(data)), np.random.default_rng(0))
    return [row[:count] for row, count in zip(batch.joints.numpy(), batch.frames.tolist(), strict=True)]
