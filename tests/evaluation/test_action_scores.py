"""Scores of action labels: measures in closed form, real motions against themselves, labels that cannot be scored."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from acted import make_acted
from tiny import pipeline  # noqa: F401

from motionary.corpus.acted import ActionLabels
from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.evaluation.action_figures import draw_uses
from motionary.evaluation.action_measures import REAL, TRAINING, Judged, class_multimodality, values_of
from motionary.evaluation.action_scores import ActionProtocol, score_actions
from motionary.evaluation.real_actions import judge_real_actions
from motionary.motion import Motion
from motionary.nn.layers import seeded
from motionary.systems.action2motion.actor import Actor
from motionary.systems.action2motion.conditioned_vae import Action2Motion, Action2MotionConfig
from motionary.systems.action2motion.variants import variants_of
from motionary.systems.judges.action_evaluator import ActionEvaluator, ActionEvaluatorConfig, ActionJudge

PROTOCOL = ActionProtocol(repetitions=2, samples=6, locomotion_samples=4, physics_motions=2)


@pytest.fixture(scope="module")
def corpus(pipeline):  # noqa: F811
    return Corpus.open(pipeline / "data/corpus")


@pytest.fixture(scope="module")
def labels(corpus):
    """Every window has labels: the few clips of the fixture would hardly share any between splits."""
    rows = np.arange(len(corpus))
    return ActionLabels(("raise", "walk"), ("raise/old", "walk/old", "walk/sad"), rows % 2, rows % 2 + rows % 4 // 3)


@pytest.fixture(scope="module")
def judge(corpus, labels):
    with seeded(0):
        config = ActionEvaluatorConfig(coarse=labels.coarse, fine=labels.fine, width=8, dim=4)
        return ActionJudge(ActionEvaluator(config, corpus.context))


@pytest.fixture(scope="module")
def actor(corpus, labels):
    models = {}
    for name, own in variants_of(("glmi_m", "cond_gru"), ("lie",)).items():
        values = {"labels": labels.fine if own["fine"] else labels.coarse, "width": 8, "latent": 3, "upstream": 2}
        with seeded(1):
            models[name] = Action2Motion(Action2MotionConfig(**values, **own), corpus.context)
    return Actor(models)


def test_multimodality_is_the_mean_over_classes():
    features = np.array([[0.0], [0.0], [1.0], [3.0], [9.0]])
    ids = np.array([0, 0, 1, 1, 2])
    values = [class_multimodality(features, ids, 2, np.random.default_rng(seed)) for seed in range(40)]
    # Class 0 gives 0, class 1 gives 0 or 2 with equal chances, class 2 has one motion and no pair.
    assert set(values) == {0.0, 1.0}
    assert class_multimodality(features[:1], ids[:1], 2, np.random.default_rng(0)) == 0.0


def test_real_motions_against_themselves(judge):
    batch = make_acted([10] * 12)
    joints = list(batch.joints.numpy())
    logits, features = judge.judge(joints)
    said = logits.argmax(1)
    own = Judged(joints, said, said, features)
    values = values_of(own, own, PROTOCOL, np.random.default_rng(0))
    assert values["fid"] == pytest.approx(0, abs=1e-6)
    assert values["accuracy"] == 1.0
    wrong = values_of(replace(own, ids=said + 1), own, PROTOCOL, np.random.default_rng(0))
    assert wrong["accuracy"] == 0.0
    apart = replace(own, features=features + 2.0)
    moved = values_of(apart, own, PROTOCOL, np.random.default_rng(0))
    assert moved["fid"] == pytest.approx(4.0 * features.shape[1], rel=1e-4)
    assert moved["diversity"] == pytest.approx(values["diversity"])


def test_every_table_has_its_rows(actor, judge, corpus, labels):
    found = score_actions(actor, judge, corpus, labels, PROTOCOL, 16)
    assert list(found["coarse"]["rows"]) == [REAL, TRAINING, "glmi_m", "cond_gru"]
    assert list(found["fine"]["rows"]) == [REAL, TRAINING, "lie_fine"]
    for row in found["coarse"]["rows"].values():
        assert {"fid", "accuracy", "diversity", "multimodality"} == set(row)
    assert {REAL, "glmi_m", "cond_gru"} <= set(found["physics"])
    assert found["physics"]["glmi_m"]["bone_change"] < 1e-5 < found["physics"]["cond_gru"]["bone_change"]
    assert "walk" in found["locomotion"]
    assert "foot_skating" in found["locomotion"]["walk"]["rows"]["glmi_m"]
    assert score_actions(actor, judge, corpus, labels, PROTOCOL, 16) == found


def test_a_judge_of_one_action_scores_nothing(actor, corpus, labels):
    with seeded(0):
        config = ActionEvaluatorConfig(coarse=labels.coarse[:1], width=8, dim=4)
        judge = ActionJudge(ActionEvaluator(config, corpus.context))
    found = score_actions(actor, judge, corpus, labels, PROTOCOL, 16)
    assert found["locomotion"] == {}
    assert not {"coarse", "fine"} & set(found)
    assert "glmi_m" in found["physics"]
    assert judge_real_actions(judge, corpus, labels, 16) == {}


def test_real_accuracy_is_that_of_the_windows(judge, corpus, labels):
    found = judge_real_actions(judge, corpus, labels, 16)
    assert found["coarse"]["windows"] == len(labels.rows(corpus, "test", mirrored=False))
    assert 0 <= found["coarse"]["accuracy"] <= 1


def test_pictures_of_every_use(actor, corpus, labels):
    found = draw_uses(actor, corpus, labels, 16)
    assert {"actions", "transitions", "interpolation"} <= set(found)
    for motions, captions in found.values():
        assert len(motions) == len(captions)
        assert all(isinstance(motion, Motion) for motion in motions)
    if "outpainting" in found:
        real, *made = found["outpainting"][0]
        for motion in made:
            assert np.allclose(motion.positions[:4], real.positions[:4], atol=1e-4)
            assert motion.frames == real.frames


@pytest.mark.parametrize("key", ["repetitions", "samples", "diversity_pairs", "physics_motions"])
def test_nothing_may_be_none(key):
    with pytest.raises(InputError, match=f"action_evaluation.{key}"):
        replace(PROTOCOL, **{key: 0})
