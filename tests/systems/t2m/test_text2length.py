"""Lengths from text: a proper distribution, learned by heart, drawn per item, independent of batch and padding."""

from __future__ import annotations

import numpy as np
import pytest
import torch
import torch.nn.functional as F

from motionary.errors import InputError
from motionary.evaluation.lengths import draw_densities, hits, length_histogram, score_lengths
from motionary.language import END, PAD, START, UNKNOWN, Sentence
from motionary.nn.layers import seeded
from motionary.systems.io import load_model, open_system, save_model
from motionary.systems.t2m.text2length import Lengths, Text2Length, Text2LengthConfig, hide_words


def model(context, **settings) -> Text2Length:
    with seeded(0):
        return Text2Length(Text2LengthConfig(**{"word_dim": 12, "text_width": 16, **settings}), context).eval()


def sentences(context) -> list[Sentence]:
    words = context.vocabulary.words[4:]
    return [Sentence("", words[:n], ("NOUN",) * n) for n in (1, 3, 7, 2, 5, 0, 4)]


def test_distributions_sum_to_one_and_do_not_depend_on_the_batch(context):
    lengths, texts = Lengths(model(context)), sentences(context)
    together = lengths.distribution(texts)
    assert together.shape == (7, 49)
    assert np.allclose(together.sum(1), 1)
    for text, row in zip(texts, together, strict=True):
        assert np.allclose(lengths.distribution([text])[0], row, atol=1e-6)


def test_draws_follow_the_distribution_and_belong_to_their_seed(context):
    lengths, text = Lengths(model(context)), sentences(context)[2]
    drawn = lengths.sample([text] * 4000, range(4000))
    share = np.bincount(np.array(drawn) // 4 - 1, minlength=49) / 4000
    assert np.abs(share - lengths.distribution([text])[0]).max() < 0.02
    assert set(np.array(drawn) % 4) == {0}
    assert min(drawn) >= 4
    assert lengths.sample([sentences(context)[0], text], [5, 17])[1] == drawn[17]
    likeliest = lengths.sample([text] * 2, [0, 1], likeliest=True)
    assert likeliest == [4 * (int(lengths.distribution([text])[0].argmax()) + 1)] * 2
    assert lengths.sample([], []) == []
    with pytest.raises(InputError, match="seeds"):
        lengths.sample([text], [1, 2])
    with pytest.raises(InputError, match="temperature"):
        lengths.sample([text], [1], temperature=0)


def test_the_loss_is_the_cross_entropy_and_a_bell_spreads_it(context, batch):
    net = model(context)
    logits = net(batch.words, batch.tags, batch.word_count)
    target = batch.frames // 4 - 1
    loss, _ = net.loss(batch, 0.0, torch.Generator())
    assert loss.item() == pytest.approx(F.cross_entropy(logits, target).item())
    spread = model(context, target_std=2.0)
    units = torch.arange(49)
    bell = torch.exp(-((units - target[:, None]) ** 2) / 8.0)
    expected = -(bell / bell.sum(1, keepdim=True) * logits.log_softmax(-1)).sum(1).mean()
    loss, logs = spread.loss(batch, 0.0, torch.Generator())
    assert loss.item() == pytest.approx(expected.item(), rel=1e-5)
    assert logs["nll"].item() == pytest.approx(spread.validate(batch)["loss"].item())


def test_tags_count_only_where_they_are_switched_on(context, batch):
    for tags in (True, False):
        net = model(context, tags=tags)
        changed = net(batch.words, (batch.tags + 1) % 15, batch.word_count)
        assert torch.allclose(net(batch.words, batch.tags, batch.word_count), changed) != tags


def test_lengths_are_learned_by_heart_and_saved(context, batch, tmp_path):
    net = model(context)
    optimizer = torch.optim.Adam(net.parameters(), 1e-2)
    for _ in range(60):
        loss, _ = net.loss(batch, 0.0, torch.Generator())
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert loss.item() < 0.05
    assert net.validate(batch)["within_1"].item() == 1
    save_model(tmp_path / "text2length", "text2length", net, context)
    again = load_model(tmp_path / "text2length")
    rows = (batch.words, batch.tags, batch.word_count)
    assert torch.equal(again(*rows), net(*rows))
    assert open_system("text2length", "text_to_length", tmp_path).context.max_tokens == 49


def test_hidden_words_are_unknown_and_special_ones_stay():
    words = torch.tensor([[START, 5, 6, 7, 8, END, PAD]]).repeat(400, 1)
    hidden = hide_words(words, 0.5, torch.Generator().manual_seed(0))
    assert torch.equal(hidden[:, [0, 5, 6]], words[:, [0, 5, 6]])
    assert 0.4 < (hidden[:, 1:5] == UNKNOWN).float().mean() < 0.6
    assert torch.equal(hidden[hidden != UNKNOWN], words[hidden != UNKNOWN])
    assert hide_words(words, 0.0, torch.Generator()) is words


def test_hits_in_closed_form():
    rows = np.full((3, 10), 0.05)
    rows[:, 4] = 0.55
    assert hits(rows, np.array([4, 5, 8])) == {
        "within_1": 0.6667,
        "within_3": 0.6667,
        "nll": round(float(-np.log([0.55, 0.05, 0.05]).mean()), 4),
    }


def test_the_report_covers_every_caption_and_the_histogram_reads_no_text(pipeline):
    from motionary.corpus.store import Corpus

    corpus = Corpus.open(pipeline / "data" / "corpus")
    histogram = length_histogram(corpus)
    assert histogram.sum() == pytest.approx(1)
    assert (histogram > 0).all()
    lengths = Lengths(model(corpus.context))
    report = score_lengths(lengths, corpus)
    rows = corpus.rows("test", captioned=True)
    rows = rows[~corpus.clips.mirrored[rows]]
    assert report["all"]["items"] == sum(len(corpus.captions_of(row)) for row in rows)
    assert report["all"]["model"].keys() == report["all"]["histogram"].keys()
    assert len(draw_densities(lengths, corpus).axes) > 0


def test_bad_settings_say_what_is_wrong():
    for name, value in (("dropout", 1.0), ("word_dropout", -0.1), ("target_std", -1.0)):
        with pytest.raises(InputError, match=name):
            Text2LengthConfig(**{name: value})
