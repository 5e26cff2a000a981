"""The judges of stylization: they learn, generalize to unseen combinations, and judge every motion by itself."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from styled import styled_corpus

from motionary.corpus.batches import Batches
from motionary.corpus.cells import style_split
from motionary.corpus.labeled import Labeled
from motionary.errors import InputError
from motionary.evaluation.classifiers import judge_real
from motionary.systems.io import load_model, save_model
from motionary.systems.judges.style_evaluator import StyleEvaluator, StyleEvaluatorConfig, StyleJudge

TINY = StyleEvaluatorConfig(width=16, dim=8, noise=0.1, group_dropout=0.1)


def trained(corpus, rows, steps=50):
    """An evaluator trained for a moment on `rows`."""
    with torch.random.fork_rng():
        torch.manual_seed(0)
        model = StyleEvaluator(TINY, corpus.context)
        optimizer = torch.optim.Adam(model.parameters(), 5e-3)
        batches = Batches(Labeled(corpus, rows, 32, balance=0.5), 24)
        for step in range(steps):
            batch = next(iter(batches.epoch(step)))
            loss, _ = model.loss(batch, 0.0, torch.Generator().manual_seed(step))
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
    return model.eval()


@pytest.fixture(scope="module")
def corpus(context):
    return styled_corpus(context)


@pytest.fixture(scope="module")
def split(corpus):
    return style_split(corpus, 0.2, 10)


@pytest.fixture(scope="module")
def model(corpus, split):
    return trained(corpus, split.labeled)


def test_it_learns_and_knows_combinations_it_never_saw(corpus, split, model):
    found = judge_real(StyleJudge(model), corpus, split)
    assert found["windows"] == len(split.test)
    assert found["style"] >= 0.9
    assert found["content"] >= 0.9
    assert set(found["cells"]) == {f"{split.styles[s]}, {split.actions[a]}" for s, a in split.cells}


def test_no_verdict_depends_on_the_batch(corpus, model):
    features = [corpus.features(i) for i in (0, 7, 20, 33)]
    together, alone = StyleJudge(model).style(features), StyleJudge(model, batch_size=1).style(features)
    for a, b in zip(together, alone, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-5)
    padded = torch.full((1, 60, corpus.context.dim), 7.0)
    padded[0, : len(features[0])] = torch.from_numpy(features[0])
    with torch.no_grad():
        logits, embedding = model.style(padded, torch.tensor([len(features[0])]))
    np.testing.assert_allclose(logits[0].numpy(), together[0][0], atol=1e-5)
    assert embedding.norm().item() == pytest.approx(1, abs=1e-5)


def test_style_and_content_share_nothing(corpus, model):
    batch = Labeled(corpus, np.arange(8), 32).collate(np.arange(8), np.random.default_rng(0))
    batch.action = torch.full_like(batch.action, -1)
    model.zero_grad()
    loss, logs = model.loss(batch, 0.0, torch.Generator().manual_seed(0))
    loss.backward()
    assert set(logs) == {"style"}
    assert all(p.grad is None for p in model.branches["content"].parameters())
    assert all(p.grad is not None for p in model.branches["style"].parameters())
    model.zero_grad()


def test_a_saved_judge_is_the_same(corpus, model, tmp_path):
    save_model(tmp_path / "style_evaluator", "style_evaluator", model, corpus.context)
    features = [corpus.features(i) for i in (3, 40)]
    judge = StyleJudge.open(tmp_path / "style_evaluator")
    np.testing.assert_array_equal(judge.content(features)[0], StyleJudge(model).content(features)[0])
    assert len(judge.hash) == 12


def test_without_labels_it_answers_nothing(context, tmp_path):
    corpus = styled_corpus(context, labels=False)
    model = StyleEvaluator(StyleEvaluatorConfig(width=8, dim=4, trained=False), corpus.context)
    save_model(tmp_path / "style_evaluator", "style_evaluator", model, corpus.context)
    judge = StyleJudge(load_model(tmp_path / "style_evaluator"))  # type: ignore[arg-type]
    assert not judge.trained
    assert judge_real(judge, corpus, style_split(corpus)) == {"windows": 0}  # type: ignore[arg-type]
    with pytest.raises(InputError, match="no style labels"):
        judge.style([corpus.features(0)])


def test_bad_values_are_named(model):
    with pytest.raises(InputError, match="at least 4 frames"):
        StyleJudge(model).style([np.zeros((3, 263), np.float32)])
    for key, value in (("width", 0), ("label_smoothing", 1.0), ("noise", -0.1), ("group_dropout", -1.0)):
        with pytest.raises(InputError, match=f"style_evaluator.{key}"):
            StyleEvaluatorConfig(**{key: value})


def test_rare_combinations_are_drawn_more_often(context):
    corpus = styled_corpus(context)
    rows = np.flatnonzero(corpus.style_ids >= 0)
    share = {}
    for balance in (0.5, 1.0):
        weights = Labeled(corpus, rows, 16, balance=balance).weights
        share[balance] = weights[corpus.style_ids[rows] == 3].sum()
    assert share[1.0] == pytest.approx(4 / 16)
    assert share[0.5] == pytest.approx(4 / (4 + 12 * 6**0.5))
    assert Labeled(corpus, rows, 16).weights is None
    with pytest.raises(InputError, match="balance"):
        Labeled(corpus, rows, 16, balance=2)


def test_windows_are_stretches_of_their_clip(context):
    corpus = styled_corpus(context)
    data = Labeled(corpus, np.array([5, 9]), 20)
    batch = data.collate(np.array([1, 0]), np.random.default_rng(1))
    assert batch.motion.shape == (2, 20, context.dim)
    for row, motion in zip((9, 5), batch.motion.numpy(), strict=True):
        whole = corpus.features(row)
        assert any(np.array_equal(whole[i : i + 20], motion) for i in range(len(whole) - 19))
    middle = Labeled(corpus, np.array([5]), 20, random=False).collate(np.array([0]), np.random.default_rng(0))
    start = (len(corpus.features(5)) - 20) // 2
    np.testing.assert_array_equal(middle.motion[0], corpus.features(5)[start : start + 20])
