"""Text to motion tokens, GRU and Transformer: Eq. 5-6, teacher forcing, ends, forced lengths, independence of batch."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import torch
import torch.nn.functional as F

from motionary.corpus.batches import Batch
from motionary.errors import InputError
from motionary.language import END, PAD, START, UNKNOWN, Sentence
from motionary.nn.decoding import sample
from motionary.nn.layers import seeded
from motionary.nn.noise import uniform_noise
from motionary.systems.io import load_model, save_model
from motionary.systems.tm2t.text2token import Text2Token, Text2TokenConfig, blank
from motionary.systems.tm2t.token_generator import Guided, TokenGenerator

CODES = 12
BOTH = pytest.mark.parametrize("architecture", ["gru", "transformer"])
SMALL = {
    "word_dim": 16, "text_width": 16, "width": 32, "num_layers": 2, "dim_feedforward": 64, "num_heads": 4,
    "max_tokens": 10, "teacher_forcing_start": 1.0, "teacher_forcing_end": 1.0,
}  # fmt: skip


def model(context, **settings) -> Text2Token:
    with seeded(0):
        return Text2Token(Text2TokenConfig(CODES, **{**SMALL, **settings}), context).eval()


def a_batch(context, items: int = 5, seed: int = 0) -> Batch:
    rng = torch.Generator().manual_seed(seed)
    count = torch.randint(1, 9, (items,), generator=rng)
    tokens = torch.randint(0, CODES, (items, 9), generator=rng) * (torch.arange(9) < count[:, None])
    lengths = torch.randint(3, 8, (items,), generator=rng)
    words = torch.randint(4, len(context.vocabulary), (items, 8), generator=rng)
    words[:, 0] = START
    words[torch.arange(items), lengths - 1] = END
    padding = torch.arange(8) >= lengths[:, None]
    tags = torch.randint(0, 15, (items, 8), generator=rng).masked_fill(padding, 0)
    words = words.masked_fill(padding, PAD)
    return Batch(torch.arange(items), words=words, tags=tags, word_count=lengths, tokens=tokens, token_count=count)


def one(batch: Batch, row: int) -> Batch:
    """A row alone, without its padding."""
    n, w, r = int(batch.token_count[row]), int(batch.word_count[row]), slice(row, row + 1)
    return Batch(
        batch.clip[r], words=batch.words[r, :w], tags=batch.tags[r, :w], word_count=batch.word_count[r],
        tokens=batch.tokens[r, :n], token_count=batch.token_count[r],
    )  # fmt: skip


@BOTH
@pytest.mark.parametrize("tags", [True, False])
@torch.no_grad()
def test_the_loss_is_the_mean_of_each_sequence_alone(context, architecture, tags):
    net, batch = model(context, architecture=architecture, tags=tags), a_batch(context)
    total, tokens = 0.0, 0
    for row in range(len(batch)):
        alone = one(batch, row)
        state = net.net.start(alone.words, alone.tags, alone.word_count)
        inputs = F.pad(alone.tokens, (1, 0), value=CODES)
        targets = F.pad(alone.tokens, (0, 1), value=CODES + 1)
        logp = torch.log_softmax(net.net.logits(net.net.unroll(state, inputs)), -1)
        total -= logp.gather(2, targets[..., None]).sum().item()
        tokens += targets.numel()
    loss, _ = net.loss(batch, 0.0, torch.Generator())
    assert loss.item() == pytest.approx(total / tokens, rel=1e-5)
    assert net.validate(batch)["loss"].item() == pytest.approx(loss.item())


@torch.no_grad()
def test_attention_is_that_of_equations_5_and_6(context):
    net, batch = model(context, dropout=0.0).net, a_batch(context)
    words, sentence = net.text(batch.words, None, batch.word_count)
    hidden = torch.randn(len(batch), 32, generator=torch.Generator().manual_seed(1))
    tokens = batch.tokens[:, 0]
    scores = net.query(hidden)[:, None] @ net.key(words).transpose(1, 2) / 32**0.5
    scores = scores.masked_fill((torch.arange(8) >= batch.word_count[:, None])[:, None], -torch.inf)
    attended = (torch.softmax(scores, -1) @ net.value(words))[:, 0]
    mixed = net.mix(torch.cat((attended, net.embedding(tokens)), -1))
    expected = net.cell(F.leaky_relu(net.norm(mixed), 0.2), hidden)
    net.positions = False
    state = net.start(batch.words, None, batch.word_count)
    assert torch.allclose(state.hidden, net.start_hidden(sentence), atol=1e-6)
    assert torch.allclose(net._advance(state, hidden, net._embed(state, tokens[:, None])[:, 0]), expected, atol=1e-5)


@BOTH
@torch.no_grad()
def test_one_step_at_a_time_equals_all_at_once_and_the_future_has_no_influence(context, architecture):
    net, batch = model(context, architecture=architecture).net, a_batch(context)
    inputs = F.pad(batch.tokens, (1, 0), value=CODES)
    at_once = net.logits(net.unroll(net.start(batch.words, batch.tags, batch.word_count), inputs))
    state = net.start(batch.words, batch.tags, batch.word_count)
    for position in range(inputs.shape[1]):
        logits, state = net.step(state, inputs[:, position])
        assert torch.allclose(logits, at_once[:, position], atol=1e-5)
    changed = inputs.clone()
    changed[:, 4:] = (changed[:, 4:] + 1) % CODES
    other = net.logits(net.unroll(net.start(batch.words, batch.tags, batch.word_count), changed))
    assert torch.allclose(other[:, :4], at_once[:, :4], atol=1e-5)
    assert not torch.allclose(other[:, 4:], at_once[:, 4:], atol=1e-3)


@torch.no_grad()
def test_free_rows_read_their_own_tokens_and_the_others_the_true_ones(context):
    net, batch = model(context), a_batch(context)
    forced, _ = net.nll(batch)
    free = torch.tensor([1, 3])
    mixed, _ = net.nll(batch, free, torch.Generator().manual_seed(0))
    again, _ = net.nll(batch, free, torch.Generator().manual_seed(0))
    assert torch.equal(mixed, again)
    same = (mixed - forced).abs().max(1).values < 1e-5
    assert same.tolist() == [True, False, True, False, True]
    assert torch.allclose(mixed[:, 0], forced[:, 0], atol=1e-6)  # the first token is read by all


def test_coins_are_tossed_for_every_sequence_at_the_scheduled_rate(context):
    net = model(context, teacher_forcing_start=0.9, teacher_forcing_end=0.1)
    seen: list[int] = []
    net.nll = lambda batch, free, generator: (seen.append(len(free)), (torch.zeros(1), torch.ones(1)))[1]
    batch = a_batch(context, items=400)
    for progress, expected in ((0.0, 0.9), (0.5, 0.5), (1.0, 0.1)):
        _, logs = net.loss(batch, progress, torch.Generator().manual_seed(3))
        assert logs["teacher_forcing"].item() == pytest.approx(expected)
        assert 1 - seen[-1] / 400 == pytest.approx(expected, abs=0.08)


def test_dropouts_hide_tokens_words_and_sentences_only_in_training(context):
    net, batch = model(context, token_dropout=0.5, word_dropout=0.5, text_dropout=0.5), a_batch(context, 64)
    assert net._sentences(batch, None)[0] is batch.words
    calm = net.nll(batch)[0]
    net.train()
    words, _, count = net._sentences(batch, torch.Generator().manual_seed(0))
    emptied = count == 2
    assert 16 < int(emptied.sum()) < 48
    assert (words[emptied][:, :2] == torch.tensor([START, END])).all()
    assert (words[emptied][:, 2:] == PAD).all()
    kept = words[~emptied]
    assert torch.equal((kept == PAD), (batch.words[~emptied] == PAD))
    hidden = (kept == UNKNOWN).sum() / (batch.words[~emptied] > END).sum()
    assert 0.35 < hidden < 0.65
    assert not torch.allclose(net.nll(batch, None, torch.Generator().manual_seed(0))[0], calm, atol=1e-3)


def generator(context, **settings) -> TokenGenerator:
    def decode(codes, count):
        valid = torch.arange(codes.shape[1]) < count[:, None]
        return (codes * valid).repeat_interleave(4, 1)[..., None].expand(-1, -1, 5).float()

    return TokenGenerator(model(context, **settings), SimpleNamespace(decode=decode), chunk=3)  # type: ignore[arg-type]


def sentences(context) -> list[Sentence]:
    words = context.vocabulary.words[4:]
    return [Sentence("", words[:n], ("NOUN",) * n) for n in (1, 3, 7, 2, 5, 0, 4)]


@BOTH
def test_motions_do_not_depend_on_the_batch(context, architecture):
    made = generator(context, architecture=architecture, text_dropout=0.1)
    texts, seeds = sentences(context), [7, 8, 9, 10, 11, 12, 13]
    for options in ({}, {"temperature": 0.7, "top_k": 5, "top_p": 0.9}, {"guidance": 2.0}, {"greedy": True}):
        together = made.generate(texts, seeds, **options)
        assert all(len(motion) % 4 == 0 and 4 <= len(motion) <= 40 for motion in together)
        for text, seed, motion in zip(texts, seeds, together, strict=True):
            assert np.array_equal(made.generate([text], [seed], **options)[0], motion)
    assert made.generate([], []) == []
    several = made.generate([texts[1]] * 20, range(20))
    assert len({m.tobytes() for m in several}) > 15
    assert len({len(m) for m in several}) > 2


@BOTH
def test_lengths_are_held_where_given(context, architecture):
    made, wanted = generator(context, architecture=architecture), [4, 5, 18, 60, 33, 40, 7]
    motions = made.generate(sentences(context), range(7), wanted)
    assert [len(motion) for motion in motions] == wanted
    assert all(motion.dtype == np.float32 for motion in motions)


@torch.no_grad()
def test_sampled_first_tokens_follow_the_softmax_and_never_start_pad_or_end(context):
    net = model(context).net
    rows = 4000
    words = torch.tensor([[START, 5, 6, END]]).expand(rows, -1)
    state = net.start(words, torch.zeros_like(words), torch.full((rows,), 4))
    start = torch.full((rows,), CODES)
    tokens, count = sample(net, state, start, CODES + 1, uniform_noise(range(rows), 4), 4, banned=(CODES, CODES + 2))
    logits = net.step(state, start)[0][0]
    logits[CODES:] = -torch.inf
    expected = torch.softmax(logits, -1)[:CODES]
    assert torch.allclose(torch.bincount(tokens[:, 0], minlength=CODES) / rows, expected, atol=0.03)
    assert count.min() >= 1
    assert not ((tokens == CODES) | (tokens == CODES + 2)).any()


def test_guidance_of_one_is_none_and_more_moves_away_from_no_text(context):
    net, batch = model(context).net, a_batch(context)
    words = (batch.words, batch.tags, batch.word_count)
    empty = blank(*words, torch.ones(len(batch), dtype=torch.bool))
    with torch.no_grad():
        start = torch.full((len(batch),), CODES)
        state, without = net.start(*words), net.start(*empty)
        plain, none = net.step(state, start)[0].log_softmax(-1), net.step(without, start)[0].log_softmax(-1)
        for scale in (1.0, 3.0):
            guided = Guided(net, scale).step((state, without), start)[0]
            assert torch.allclose(guided, none + scale * (plain - none), atol=1e-5)


@BOTH
def test_one_batch_is_learned_by_heart(context, architecture, tmp_path):
    net, batch = model(context, architecture=architecture), a_batch(context, items=6)
    optimizer = torch.optim.Adam(net.parameters(), 1e-2)
    for _ in range(90):
        loss, _ = net.loss(batch, 0.0, torch.Generator().manual_seed(0))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert loss.item() < 0.02
    save_model(tmp_path / "text2token", "text2token", net, context)
    net = load_model(tmp_path / "text2token")
    assert isinstance(net, Text2Token)
    state = net.net.start(batch.words, batch.tags, batch.word_count)
    noise = uniform_noise(range(6), 12) * 0.9 + 0.05
    tokens, count = sample(net.net, state, torch.full((6,), CODES), CODES + 1, noise, 12)
    assert torch.equal(count, batch.token_count)
    assert torch.equal(tokens[:, :9].masked_fill(tokens[:, :9] == CODES + 1, 0), batch.tokens)


def test_bad_settings_say_what_is_wrong(context):
    for name, value in (("architecture", "lstm"), ("teacher_forcing_end", 1.5), ("temperature", 0), ("guidance", 2)):
        with pytest.raises(InputError, match=name):
            Text2TokenConfig(CODES, **{name: value})  # type: ignore[arg-type]
    made = generator(context)
    with pytest.raises(InputError, match="text_dropout"):
        made.generate(sentences(context), range(7), guidance=2.0)
    with pytest.raises(InputError, match="seeds"):
        made.generate(sentences(context), [1])
    with pytest.raises(InputError, match="beams"):
        made.generate(sentences(context), range(7), beams=2)
    with pytest.raises(InputError, match="frames"):
        made.generate(sentences(context), range(7), [4] * 6)
