"""Contrastive extractors (TM2T Eq. 8)."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.language import STATE_DIM, annotate
from motionary.nn.layers import seeded
from motionary.systems.judges.contrastive import infonce_loss, margin_loss
from motionary.systems.judges.evaluator import Evaluator, EvaluatorConfig
from motionary.systems.judges.judge import Judge
from motionary.systems.t2m.autoencoder import Autoencoder, AutoencoderConfig

SNIPPETS = AutoencoderConfig(width=24, code_dim=16)
SMALL = EvaluatorConfig(text_width=16, motion_width=24, dim=12, word_dim=10, dropout=0.0)


def build(context, **changes):
    with seeded(0):
        autoencoder = Autoencoder(SNIPPETS, context)
        config = dataclasses.replace(SMALL, **autoencoder.config.as_upstream(), **changes)
        return Evaluator(config, context).take_snippets(autoencoder.encoder), autoencoder


def embed(model, batch):
    return (
        model.embed_text(batch.words, batch.tags, batch.word_count),
        model.embed_motion(batch.motion, batch.frames),
    )


def test_margin_loss_in_closed_form():
    text, motion = (
        torch.tensor([[0.0, 0.0], [3.0, 4.0], [0.0, 20.0]]),
        torch.tensor([[3.0, 4.0], [3.0, 4.0], [0.0, 19.0]]),
    )
    same = torch.eye(3, dtype=torch.bool)
    matched = 5.0**2 + 0.0 + 1.0
    # motion i with text i + 1: distances 0, sqrt(9 + 256), 19
    pushed = 10.0**2 + 0.0 + 0.0
    assert float(margin_loss(text, motion, same, 1, 10.0)) == pytest.approx((matched + pushed) / 6)
    same[0, 1] = same[1, 0] = True  # an equal caption is no mismatch
    assert float(margin_loss(text, motion, same, 1, 10.0)) == pytest.approx(matched / 5)


def test_infonce_in_closed_form_and_without_equal_captions():
    text = torch.nn.functional.normalize(torch.randn(3, 4, generator=torch.Generator().manual_seed(0)), dim=-1)
    motion = torch.nn.functional.normalize(torch.randn(3, 4, generator=torch.Generator().manual_seed(1)), dim=-1)
    cosines = motion @ text.t() / 0.5
    rows = torch.stack([cosines[i, i] - cosines[i].logsumexp(0) for i in range(3)])
    columns = torch.stack([cosines[i, i] - cosines[:, i].logsumexp(0) for i in range(3)])
    expected = -0.5 * (rows.mean() + columns.mean())
    same = torch.eye(3, dtype=torch.bool)
    torch.testing.assert_close(infonce_loss(5 * text, 2 * motion, same, 0.5), expected)
    same[0, 1] = same[1, 0] = True
    masked = infonce_loss(text, motion, same, 0.5)
    kept = [[0, 2], [1, 2], [0, 1, 2]]
    rows = torch.stack([cosines[i, i] - cosines[i, k].logsumexp(0) for i, k in enumerate(kept)])
    columns = torch.stack([cosines[i, i] - cosines[k, i].logsumexp(0) for i, k in enumerate(kept)])
    torch.testing.assert_close(masked, -0.5 * (rows.mean() + columns.mean()))


@pytest.mark.parametrize("objective", ["infonce", "margin"])
def test_one_batch_is_learned(context, batches, objective):
    model, _ = build(context, objective=objective, margin=2.0)
    batch = batches(context, [32, 24, 16, 28, 32, 20])
    optimizer = torch.optim.Adam([p for p in model.parameters() if p.requires_grad], 3e-3)
    start = float(model.validate(batch)["loss"])
    for step in range(160):
        loss, _ = model.loss(batch, 0.0, torch.Generator().manual_seed(step))
        loss.backward()
        optimizer.step()
        optimizer.zero_grad()
    values = model.eval().validate(batch)
    assert float(values["loss"]) < 0.35 * start
    text, motion = embed(model, batch)
    first = torch.cdist(motion, text).argmin(1) == torch.arange(6)
    assert float(first.float().mean()) > 0.8


def test_embeddings_do_not_depend_on_padding_or_batch(context, batch):
    model, _ = build(context)
    model.eval()
    text, motion = embed(model, batch)
    assert text.shape == motion.shape == (4, 12)
    torch.testing.assert_close(text.norm(dim=-1), torch.full((4,), 10.0))
    batch.motion[2, 16:] = 1e4
    words = int(batch.word_count[2])
    torch.testing.assert_close(model.embed_motion(batch.motion, batch.frames)[2], motion[2])
    torch.testing.assert_close(model.embed_motion(batch.motion[2:3, :16], batch.frames[2:3])[0], motion[2])
    alone = model.embed_text(batch.words[2:3, :words], batch.tags[2:3, :words], batch.word_count[2:3])
    torch.testing.assert_close(alone[0], text[2])


def test_snippets_are_the_autoencoder_s_and_stay_frozen(context, batch):
    model, autoencoder = build(context)
    torch.testing.assert_close(
        model.snippets(batch.motion, batch.frames), autoencoder.encode(batch.motion, batch.frames).detach()
    )
    model.loss(batch, 0.0, torch.Generator())[0].backward()
    assert all(p.grad is None for p in model.snippets.parameters())
    assert any("snippets" in name for name in model.state_dict())
    for name, p in model.named_parameters():
        if not name.startswith("snippets"):
            assert p.grad is not None, name


def test_contacts_do_not_count(context, batch):
    model, _ = build(context)
    model.eval()
    before = model.embed_motion(batch.motion, batch.frames)
    batch.motion[..., -4:] += 1
    assert torch.equal(model.embed_motion(batch.motion, batch.frames), before)


def test_tags_count_unless_switched_off(context, batch):
    other = (batch.tags + 1) % 15
    for tags in (True, False):
        model, _ = build(context, tags=tags)
        model.eval()
        a = model.embed_text(batch.words, batch.tags, batch.word_count)
        b = model.embed_text(batch.words, other, batch.word_count)
        assert torch.equal(a, b) == (not tags)


def test_sentences_of_frozen_states_are_learned_and_do_not_depend_on_padding(context, batches):
    model, _ = build(context, text="sentence")
    batch = batches(context, [32, 24, 16, 28, 32, 20])
    count = torch.tensor([3, 5, 4, 6, 3, 4])
    batch.states = torch.randn(6, 6, STATE_DIM, generator=torch.Generator().manual_seed(0))
    batch.states *= (torch.arange(6) < count[:, None])[..., None]
    batch.state_count = count
    assert model.reads_states
    assert not any("words" in name for name in model.state_dict())
    optimizer = torch.optim.Adam([p for p in model.parameters() if p.requires_grad], 3e-3)
    start = float(model.validate(batch)["loss"])
    for step in range(60):
        model.loss(batch, 0.0, torch.Generator().manual_seed(step))[0].backward()
        optimizer.step()
        optimizer.zero_grad()
    values = model.eval().validate(batch)
    assert float(values["loss"]) < 0.35 * start
    assert float(values["top1"]) > 0.8
    text = model.embed_states(batch.states, count)
    torch.testing.assert_close(model.embed_states(batch.states[2:3, :4], count[2:3])[0], text[2], atol=1e-4, rtol=1e-4)


@pytest.mark.parametrize("name", ["evaluator", "joint_evaluator"])
def test_a_judge_of_either_kind_answers_each_alone_as_in_company(pipeline, name):
    judge, corpus = Judge(pipeline / "models" / name, batch_size=3), Corpus.open(pipeline / "data/corpus")
    features = [corpus.features(row) for row in range(7)]
    sentences = annotate(["a person walks", "an old man waves with the left hand for a while", "someone sits", "jumps"])
    motions, texts = judge.motions(features), judge.sentences(sentences)
    assert motions.shape[1] == texts.shape[1]
    for i in (0, 5):
        np.testing.assert_allclose(judge.motions([features[i]])[0], motions[i], atol=1e-3)
    for i in range(4):
        np.testing.assert_allclose(judge.sentences([sentences[i]])[0], texts[i], atol=2e-2)
    assert np.abs(texts[0] - texts[1]).max() > 0.1


def test_wrong_values_are_named(context, batch):
    with pytest.raises(InputError, match=r"evaluator\.objective"):
        EvaluatorConfig(objective="triplet")
    with pytest.raises(InputError, match=r"evaluator\.text: letters: must be one of words, sentence"):
        EvaluatorConfig(text="letters")
    with pytest.raises(InputError, match=r"evaluator\.temperature"):
        EvaluatorConfig(temperature=0.0)
    model, _ = build(context)
    with pytest.raises(InputError, match="at least 4 frames"):
        model.embed_motion(batch.motion, torch.tensor([32, 2, 16, 28]))
