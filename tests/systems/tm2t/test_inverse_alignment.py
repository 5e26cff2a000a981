"""Inverse alignment: where Eq. 7's gradients go, what is masked, and where it starts from."""

from __future__ import annotations

import pytest
import torch
import torch.nn.functional as F

from motionary.corpus.batches import Batch
from motionary.errors import InputError
from motionary.language import END, PAD, START
from motionary.nn.layers import seeded
from motionary.systems.io import Trained, build_model, load_model, save_model
from motionary.systems.tm2t.inverse_alignment import InverseAlignment, InverseAlignmentConfig
from motionary.systems.tm2t.motion2text import Motion2Text, Motion2TextConfig
from motionary.systems.tm2t.text2token import Text2Token, Text2TokenConfig
from motionary.systems.tm2t.token_gru import StraightThrough
from motionary.systems.tm2t.tokenizer import Tokenizer, TokenizerConfig

CODES = 12
SMALL = {
    "word_dim": 16, "text_width": 16, "width": 32, "max_tokens": 10,
    "teacher_forcing_start": 1.0, "teacher_forcing_end": 1.0,
}  # fmt: skip


def reader(context, **settings) -> Motion2Text:
    small = {"width": 32, "num_layers": 1, "dim_feedforward": 64, "num_heads": 4, "dropout": 0.3}
    with seeded(1):
        return Motion2Text(Motion2TextConfig(CODES, **{**small, **settings}), context)


def model(context, **settings) -> InverseAlignment:
    with seeded(0):
        net = InverseAlignment(InverseAlignmentConfig(CODES, **{**SMALL, **settings}), context)
    net.learn_from(reader(context))
    return net


def a_batch(context, items: int = 6) -> Batch:
    rng = torch.Generator().manual_seed(0)
    count = torch.randint(1, 9, (items,), generator=rng)
    tokens = torch.randint(0, CODES, (items, 9), generator=rng) * (torch.arange(9) < count[:, None])
    lengths = torch.randint(3, 8, (items,), generator=rng)
    words = torch.randint(4, len(context.vocabulary), (items, 8), generator=rng)
    words[:, 0] = START
    words[torch.arange(items), lengths - 1] = END
    words = words.masked_fill(torch.arange(8) >= lengths[:, None], PAD)
    tags = torch.zeros_like(words)
    return Batch(torch.arange(items), words=words, tags=tags, word_count=lengths, tokens=tokens, token_count=count)


def test_gradients_reach_the_generator_and_never_the_reader(context):
    net, batch = model(context), a_batch(context)
    net.train()
    frozen = net._reader[0]
    before = {name: p.clone() for name, p in frozen.named_parameters()}
    loss, _ = net.caption_loss(batch, torch.Generator().manual_seed(0))
    loss.backward()
    assert not frozen.training
    assert all(p.grad is None and not p.requires_grad for p in frozen.parameters())
    assert all(torch.equal(before[name], p) for name, p in frozen.named_parameters())
    unused = {name for name, p in net.named_parameters() if p.grad is None or not p.grad.abs().sum() > 0}
    assert unused == set()
    assert not any("_reader" in name for name in net.state_dict())


def test_the_objective_is_the_sum_of_equation_7_and_the_control_its_first_term(context):
    batch = a_batch(context)
    net = model(context, caption_weight=0.5).eval()
    loss, logs = net.loss(batch, 0.0, torch.Generator().manual_seed(0))
    assert loss.item() == pytest.approx(logs["token_nll"].item() + 0.5 * logs["caption_nll"].item(), rel=1e-5)
    control = model(context, alignment=False).eval()
    alone, logs = control.loss(batch, 0.0, torch.Generator().manual_seed(0))
    assert "caption_nll" not in logs
    assert alone.item() == pytest.approx(Text2Token.loss(net, batch, 0.0, torch.Generator().manual_seed(0))[0].item())
    values = net.validate(batch)
    assert values["loss"].item() == pytest.approx(values["token_nll"].item() + 0.5 * values["caption_nll"].item())
    assert values["loss"].item() == net.validate(batch)["loss"].item()
    read = control.validate(batch)  # the control is compared by the captions' loss, but never trained by it
    assert read["loss"].item() == read["token_nll"].item() == pytest.approx(values["token_nll"].item())
    assert read["caption_nll"].item() == pytest.approx(values["caption_nll"].item())


def test_a_share_of_the_batch_can_be_sampled(context):
    batch, net = a_batch(context), model(context, sampled_share=0.5).eval()
    whole, drawn = model(context).eval(), set()
    for seed in range(6):
        rng = torch.Generator().manual_seed(seed)
        rows = torch.randperm(len(batch.clip), generator=rng)[: len(batch.clip) // 2]  # batches are sorted by length
        half = Batch(
            batch.clip[rows], words=batch.words[rows], tags=batch.tags[rows], word_count=batch.word_count[rows]
        )
        value = net.caption_loss(batch, torch.Generator().manual_seed(seed))[0]
        assert value.item() == pytest.approx(whole.caption_loss(half, rng)[0].item())
        drawn |= set(rows.tolist())
    assert drawn == set(range(len(batch.clip)))


def test_straight_through_is_one_hot_forward_and_the_identity_backward():
    soft = torch.softmax(torch.randn(5, 7, generator=torch.Generator().manual_seed(0)), -1).requires_grad_()
    hard = StraightThrough.apply(soft)
    assert torch.equal(hard, F.one_hot(soft.argmax(-1), 7).float())
    weight = torch.randn(5, 7, generator=torch.Generator().manual_seed(1))
    (hard * weight).sum().backward()
    assert torch.equal(soft.grad, weight)


@torch.no_grad()
def test_samples_follow_the_model_and_never_hold_start_or_padding(context):
    net = model(context).eval()
    rows = 3000
    words = torch.tensor([[START, 5, 6, END]]).expand(rows, -1)
    state = net.net.start(words, torch.zeros_like(words), torch.full((rows,), 4))
    start = torch.full((rows,), CODES)
    samples = net.net.gumbel(state, start, 5, CODES + 1, 1.0, torch.Generator().manual_seed(0))
    assert samples.shape == (rows, 5, CODES + 3)
    assert ((samples == 0) | (samples == 1)).all()
    assert (samples.sum(-1) == 1).all()
    assert samples[..., [CODES, CODES + 2]].sum() == 0
    assert samples[:, 0, CODES + 1].sum() == 0
    logits, after = net.net.step(state, start)
    expected = torch.softmax(logits[0, :CODES], -1)
    assert torch.allclose(samples[:, 0, :CODES].mean(0), expected, atol=0.03)
    second, _ = net.net.step(after, samples[:, 0].argmax(-1))
    second[:, [CODES, CODES + 2]] = -torch.inf
    assert torch.allclose(samples[:, 1].mean(0), torch.softmax(second, -1).mean(0), atol=0.03)


def test_a_sequence_is_masked_behind_its_end_and_closed_where_it_has_none(context):
    net, end = model(context), CODES + 1
    ids = torch.tensor([[3, end, 5, 6], [1, 2, 3, 4], [1, 2, 3, end], [1, 2, end, end]])
    samples = F.one_hot(ids, CODES + 3).float().requires_grad_()
    source, mask = net._as_source(samples, torch.full((4,), CODES))
    assert source[0, 0].argmax() == CODES
    assert mask.sum(1).tolist() == [3, 5, 5, 4]
    for row, expected in enumerate(([3, end], [1, 2, 3, end], [1, 2, 3, end], [1, 2, end])):
        assert source[row, 1 : 1 + len(expected)].argmax(-1).tolist() == expected
        assert source[row, 1 + len(expected) :].abs().sum() == 0
    assert torch.equal(source.sum(-1), mask.float())
    # The choice of an end takes part: had row 2 ended at once, its later tokens would not count.
    (source[2, 2:] * mask[2, 2:, None]).sum().backward()
    assert samples.grad[2, 0, end] < 0


def test_it_starts_from_text2token_and_stands_alone_afterwards(context, tmp_path):
    with seeded(3):
        tokenizer = Tokenizer(TokenizerConfig(codebook_size=CODES, code_dim=8, width=8, fine_width=8), context)
        upstream = Text2Token(Text2TokenConfig(CODES, temperature=0.8, **SMALL), context)
    save_model(tmp_path / "tokenizer", "tokenizer", tokenizer, context)
    save_model(tmp_path / "text2token", "text2token", upstream, context)
    save_model(tmp_path / "motion2text", "motion2text", reader(context), context)
    net = build_model("inverse_alignment", {"caption_weight": 2.0, "dropout": 0.2}, context, Trained(tmp_path))
    assert (net.config.temperature, net.config.dropout, net.config.caption_weight) == (0.8, 0.2, 2.0)
    for name, value in upstream.state_dict().items():
        assert torch.equal(net.state_dict()[name], value)
    loss, _ = net.loss(a_batch(context), 0.0, torch.Generator().manual_seed(0))
    loss.backward()
    save_model(tmp_path / "inverse_alignment", "inverse_alignment", net, context)
    again = load_model(tmp_path / "inverse_alignment")
    assert isinstance(again, InverseAlignment)
    assert torch.equal(again.net.out.weight, net.net.out.weight)
    with pytest.raises(InputError, match="motion2text"):
        again.loss(a_batch(context), 0.0, torch.Generator())


def test_what_cannot_be_aligned_is_refused(context):
    with pytest.raises(InputError, match="gru"):
        InverseAlignmentConfig(CODES, architecture="transformer")
    with pytest.raises(InputError, match="sampled_share"):
        InverseAlignmentConfig(CODES, sampled_share=0.0)
    with pytest.raises(InputError, match="motion2text"):
        model(context).learn_from(reader(context, tokens=False))


def test_the_caption_loss_falls_when_only_it_is_trained(context):
    """A reader whose caption is decided by which codes it sees pulls the samples towards the right codes."""
    net, batch = model(context), a_batch(context)
    expert = reader(context, dropout=0.0)
    optimizer = torch.optim.Adam(expert.parameters(), 1e-2)
    for _ in range(60):
        loss, _ = expert.loss(batch, 0.0, torch.Generator())
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    net.learn_from(expert)
    optimizer = torch.optim.Adam(net.parameters(), 2e-2)
    losses = []
    for step in range(30):
        loss, _ = net.caption_loss(batch, torch.Generator().manual_seed(step))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert sum(losses[-5:]) < 0.7 * sum(losses[:5])
