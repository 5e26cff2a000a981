"""Curves show what changes, and nothing else."""

from __future__ import annotations

from motionary.pipeline.learning_curves import draw_curves
from motionary.training.loop import History


def titles(train: list[dict], validation: list[dict]) -> list[str]:
    history = History()
    history.train.extend(train)
    history.validation.extend(validation)
    return [axis.get_title() for axis in draw_curves(history, "x").axes]


def test_constant_curves_and_single_points_are_left_out():
    train = [{"step": s, "learning_rate": 0.1 * s, "loss": 1.0 / s, "weight": 2.0} for s in (1, 2, 3)]
    assert titles(train, [{"step": 3, "loss": 0.5, "accuracy": 0.5}]) == ["x: loss"]
    assert titles(train, [{"step": s, "accuracy": s} for s in (1, 2)]) == ["x: accuracy", "x: loss"]
    assert titles([{"step": 1, "loss": 1.0}], []) == []
