"""The judge of actions: it learns to tell them, padding changes nothing, and what it lacks it says."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from acted import LABELS, acted_context, make_acted

from motionary.errors import InputError
from motionary.nn.layers import seeded
from motionary.systems.io import load_model, save_model
from motionary.systems.judges.action_evaluator import ActionEvaluator, ActionEvaluatorConfig, ActionJudge


def make(context, **settings) -> ActionEvaluator:
    with seeded(0):
        values = {"coarse": LABELS, "fine": ("a", "b"), "width": 16, "dim": 6} | settings
        return ActionEvaluator(ActionEvaluatorConfig(**values), acted_context(context))


def motions(frames, seed=0):
    batch = make_acted(frames, seed)
    return [row[:count] for row, count in zip(batch.joints.numpy(), frames, strict=True)], batch


def test_it_learns_both_kinds_of_labels(context):
    model = make(context)
    optimizer = torch.optim.Adam(model.parameters(), 1e-2)
    _, batch = motions([16, 12] * 6)
    for step in range(30):
        loss, logs = model.loss(batch, 0.0, torch.Generator().manual_seed(step))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert float(logs["coarse"]) == float(logs["fine"]) == 1.0
    held, _ = motions([14, 15, 9, 16], seed=1)
    judge = ActionJudge(model)
    assert judge.judge(held)[0].argmax(1).tolist() == [0, 1, 0, 1]
    assert judge.judge(held, "fine")[0].argmax(1).tolist() == [1, 0, 1, 0]


def test_a_verdict_depends_on_its_motion_alone(context):
    judge = ActionJudge(make(context))
    several, _ = motions([16, 8, 12])
    together = judge.judge(several)
    for i, motion in enumerate(several):
        alone = judge.judge([motion])
        for a, b in zip(alone, together, strict=True):
            assert np.allclose(a[0], b[i], atol=1e-5)
    assert together[1].shape == (3, 6)


def test_a_kind_with_one_class_is_left_out(context, tmp_path):
    model = make(context, fine=("only",))
    assert ActionJudge(model).labels == {"coarse": LABELS}
    with pytest.raises(InputError, match="fewer than two"):
        ActionJudge(model).judge(motions([8])[0], "fine")
    save_model(tmp_path, "action_evaluator", model, model.context)
    opened = ActionJudge.open(tmp_path)
    assert isinstance(load_model(tmp_path), ActionEvaluator)
    assert np.array_equal(opened.judge(motions([8])[0])[0], ActionJudge(model).judge(motions([8])[0])[0])
    assert len(opened.hash) == 12


def test_unknown_labels_are_left_out(context):
    model, (_, batch) = make(context).eval(), motions([8, 8, 8])
    batch.action[2] = batch.fine[2] = -1
    kept = motions([8, 8])[1]
    assert torch.allclose(model.loss(batch, 0, torch.Generator())[0], model.loss(kept, 0, torch.Generator())[0])
