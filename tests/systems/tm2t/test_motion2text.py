"""Motion to text: Eq. 4, cached decoding, independence of padding and batch, the ablation without tokens."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import torch
import torch.nn.functional as F

from motionary.corpus.batches import Batch
from motionary.corpus.context import Context
from motionary.errors import InputError
from motionary.language import END, PAD, START, UNKNOWN
from motionary.language.consensus import agreement, consensus
from motionary.nn.decoding import beam_search, sample
from motionary.nn.layers import seeded
from motionary.nn.noise import uniform_noise
from motionary.systems.io import Trained, build_model, load_model, open_system, save_model
from motionary.systems.tm2t.captioner import Captioner
from motionary.systems.tm2t.motion2text import (
    Motion2Text,
    Motion2TextConfig,
    member_name,
    member_seeds,
)
from motionary.systems.tm2t.tokenizer import Tokenizer, TokenizerConfig

CODES, DIM = 12, 263


def model(context: Context, seed: int = 0, **settings) -> Motion2Text:
    small = {"width": 32, "num_layers": 2, "dim_feedforward": 64, "num_heads": 4, "dropout": 0.0, "max_words": 8}
    with seeded(seed):
        return Motion2Text(Motion2TextConfig(CODES, **{**small, **settings}), context).eval()


def a_batch(context: Context, items: int = 5, seed: int = 0, motion: bool = False) -> Batch:
    rng = torch.Generator().manual_seed(seed)
    count = torch.randint(2, 9, (items,), generator=rng)
    tokens = torch.randint(0, CODES, (items, 9), generator=rng) * (torch.arange(9) < count[:, None])
    lengths = torch.randint(3, 8, (items,), generator=rng)
    words = torch.randint(4, len(context.vocabulary), (items, 8), generator=rng)
    words[:, 0] = START
    words[torch.arange(items), lengths - 1] = END
    words = words.masked_fill(torch.arange(8) >= lengths[:, None], PAD)
    batch = Batch(torch.arange(items), words=words, word_count=lengths, tokens=tokens, token_count=count)
    if motion:
        batch.frames = count * 4
        valid = torch.arange(36) < batch.frames[:, None]
        batch.motion = torch.randn(items, 36, DIM, generator=rng) * valid[..., None]
    return batch


def one(batch: Batch, row: int) -> Batch:
    """A row alone, without its padding."""
    n, w = int(batch.token_count[row]), int(batch.word_count[row])
    alone = Batch(
        batch.clip[row : row + 1],
        words=batch.words[row : row + 1, :w],
        word_count=batch.word_count[row : row + 1],
        tokens=batch.tokens[row : row + 1, :n],
        token_count=batch.token_count[row : row + 1],
    )
    if "motion" in vars(batch):
        alone.motion, alone.frames = batch.motion[row : row + 1, : 4 * n], batch.frames[row : row + 1]
    return alone


@pytest.mark.parametrize("tokens", [True, False])
def test_the_loss_is_the_mean_negative_log_likelihood_and_ignores_padding(context, tokens):
    net, batch = model(context, tokens=tokens), a_batch(context, motion=True)
    total, words = 0.0, 0
    for row in range(len(batch)):
        alone = one(batch, row)
        source, mask = net.source_of(alone)
        logp = torch.log_softmax(net.logits(source, mask, alone.words[:, :-1]), -1)
        total -= logp.gather(2, alone.words[:, 1:, None]).sum().item()
        words += alone.words.shape[1] - 1
    loss, logs = net.loss(batch, 0.0, torch.Generator())
    assert loss.item() == pytest.approx(total / words, rel=1e-5)
    assert logs["caption_nll"].item() == pytest.approx(loss.item())
    assert net.validate(batch)["loss"].item() == pytest.approx(loss.item())


def test_the_source_has_a_start_an_end_and_padding(context):
    ids, mask = model(context).token_source(torch.tensor([[3, 4, 0], [5, 6, 7]]), torch.tensor([2, 3]))
    assert ids.tolist() == [[CODES, 3, 4, CODES + 1, CODES + 2], [CODES, 5, 6, 7, CODES + 1]]
    assert mask.tolist() == [[True] * 4 + [False], [True] * 5]


def test_one_hot_tokens_read_as_their_ids_and_carry_gradients(context):
    net, batch = model(context), a_batch(context)
    ids, mask = net.token_source(batch.tokens, batch.token_count)
    soft = F.one_hot(ids, CODES + 3).float().requires_grad_()
    hard, _ = net.nll(net.embed(ids), mask, batch.words)
    relaxed, _ = net.nll(net.embed(soft), mask, batch.words)
    assert torch.allclose(hard, relaxed, atol=1e-5)
    relaxed.sum().backward()
    assert soft.grad[mask].abs().sum() > 0
    assert soft.grad[~mask].abs().max() == 0


def test_words_depend_on_the_past_only_and_on_the_whole_source(context):
    net, batch = model(context), a_batch(context)
    source, mask = net.source_of(batch)
    before = net.logits(source, mask, batch.words)
    changed = batch.words.clone()
    changed[:, 2:] = 5
    assert torch.allclose(before[:, :2], net.logits(source, mask, changed)[:, :2], atol=1e-6)
    assert not torch.allclose(before[:, 2:], net.logits(source, mask, changed)[:, 2:], atol=1e-3)


class WithoutCache:
    """The same model, run over the whole prefix at every step."""

    def __init__(self, net: Motion2Text):
        self.net = net

    def step(self, state, tokens):
        source, mask, prefix = state
        prefix = torch.cat((prefix, tokens[:, None]), dim=1)
        return self.net.logits(source, mask, prefix)[:, -1], (source, mask, prefix)

    def reorder(self, state, index):
        return tuple(part[index] for part in state)


@torch.no_grad()
def test_decoding_with_a_cache_equals_decoding_without(context):
    net, batch = model(context), a_batch(context)
    source, mask = net.source_of(batch)
    start, slow = torch.full((len(batch),), START), WithoutCache(net)
    first = (source, mask, torch.zeros(len(batch), 0, dtype=torch.long))
    for width in (1, 3):
        fast = beam_search(net, net.start(source, mask), start, END, width, width, 8, banned=(PAD, START))
        plain = beam_search(slow, first, start, END, width, width, 8, banned=(PAD, START))
        for a, b in zip(fast, plain, strict=True):
            assert [h.tokens for h in a] == [h.tokens for h in b]
            assert [h.score for h in a] == pytest.approx([h.score for h in b], abs=1e-5)
    noise = uniform_noise(range(len(batch)), 8)
    drawn = [sample(d, s, start, END, noise, 8) for d, s in ((net, net.start(source, mask)), (slow, first))]
    assert torch.equal(drawn[0][0], drawn[1][0])


def captioner(context: Context, **settings) -> Captioner:
    members = [model(context, seed=number, **settings) for number in range(settings.get("members", 1))]
    weights = torch.randn(DIM, generator=torch.Generator().manual_seed(1))

    def encode(raw, frames):  # a stand-in tokenizer: a code per unit of four frames
        codes = (raw.unflatten(1, (-1, 4)).mean(2) @ weights).abs().mul(3).long() % CODES
        return codes * (torch.arange(codes.shape[1]) < (frames // 4)[:, None])

    tokenizer = SimpleNamespace(encode=encode) if members[0].config.tokens else None
    return Captioner(members, tokenizer, chunk=3)  # type: ignore[arg-type]


@pytest.mark.parametrize(("tokens", "members"), [(True, 1), (True, 2), (False, 1)])
def test_captions_do_not_depend_on_the_batch(context, tokens, members):
    rng = np.random.default_rng(0)
    motions = [rng.normal(size=(n, DIM)).astype(np.float32) for n in (40, 3, 17, 80, 64)]
    made = captioner(context, tokens=tokens, ensemble=members)
    searched = made.caption(motions, beams=3, n=2)
    sampled = made.caption(motions, n=3, seeds=[4, 5, 6, 7, 8], temperature=1.0)
    assert [len(c) for c in searched] == [2] * 5
    assert [len(c) for c in sampled] == [3] * 5
    assert all(caption for captions in searched + sampled for caption in captions)
    assert len({tuple(c) for c in sampled}) == 5
    for i, motion in enumerate(motions):
        assert made.caption([motion], beams=3, n=2)[0] == searched[i]
        assert made.caption([motion], n=3, seeds=[4 + i], temperature=1.0)[0] == sampled[i]
    agreed = made.caption(motions, consensus=6)
    assert [made.caption([motion], consensus=6)[0] for motion in motions] == agreed
    assert made.caption([]) == []


def test_a_motion_is_read_from_every_shift(context):
    rng = np.random.default_rng(0)
    motions = [rng.normal(size=(n, DIM)).astype(np.float32) for n in (16, 6, 3)]
    made, read = captioner(context, offsets=4), []
    made.chunk = 64
    encode = made.tokenizer.encode
    made.tokenizer.encode = lambda raw, frames: read.append((raw.numpy(), frames.tolist())) or encode(raw, frames)
    made.caption(motions)
    [(raw, frames)] = read
    assert frames == [4] * 8 + [16, 12, 12, 12]  # whole units, shortest motion first
    for row, start in zip(raw[8:], range(4), strict=True):
        np.testing.assert_array_equal(row[: 16 - start], motions[0][start:])
    for row, start in zip(raw[4:8], (0, 1, 2, 2), strict=True):
        np.testing.assert_array_equal(row[:4], motions[1][start : start + 4])
    with pytest.raises(InputError, match=r"offsets: 5: must lie in 1\.\.4"):
        model(context, offsets=5)


@pytest.mark.parametrize("members", [1, 2])
def test_readings_and_members_are_averaged_in_the_search_and_take_turns_in_draws(context, members):
    motion = np.random.default_rng(2).normal(size=(18, DIM)).astype(np.float32)
    made = captioner(context, offsets=3, ensemble=members)
    tokens = torch.zeros(3, 4, dtype=torch.long)
    count = torch.tensor([4, 4, 4])
    for start in range(3):
        tokens[start] = made.tokenizer.encode(torch.tensor(motion[None, start : start + 16]), torch.tensor([16]))
    sources = [net.embed_tokens(tokens, count) for net in made.members]
    words = [START]
    for _ in range(made.config.max_words):  # greedy by hand, without a cache
        given = torch.tensor([words] * 3)
        logits = [net.logits(*source, given)[:, -1] for net, source in zip(made.members, sources, strict=True)]
        scores = torch.cat(logits).softmax(-1).mean(0)
        scores[[PAD, START, UNKNOWN]] = -torch.inf  # what is never said
        if len(words) == 1:
            scores[END] = -torch.inf
        words.append(int(scores.argmax()))
        if words[-1] == END:
            break
    expected = context.vocabulary.decode(np.array([w for w in words[1:] if w != END]))
    assert made.caption([motion], beams=1) == [[expected]]
    drawn = made.caption([motion], n=13, seeds=[3], temperature=1.0)[0]
    for number, net in enumerate(made.members):
        alone = Captioner([model(context, seed=number)], made.tokenizer)
        assert torch.equal(alone.members[0].words.weight, net.words.weight)
        for start in range(3):
            turns = slice(number + members * start, None, 3 * members)
            assert drawn[turns] == alone.caption([motion[start:]], n=13, seeds=[3], temperature=1.0)[0][turns]


def test_poses_are_read_by_as_many_frames_as_asked(context):
    batch = a_batch(context, motion=True)
    for frames, positions in ((1, 36), (2, 18), (4, 9)):
        net = model(context, tokens=False, pose_frames=frames)
        source, mask = net.source_of(batch)
        assert source.shape == (5, positions, 32)
        assert mask.sum(1).tolist() == (batch.frames // frames).tolist()
        poses = net.normalizer(batch.motion)[0, :frames].flatten()
        torch.testing.assert_close(source[0, 0], net.source.weight @ poses + net.source.bias)
    with pytest.raises(InputError, match="pose_frames: 3: must divide the unit of 4"):
        model(context, tokens=False, pose_frames=3)


def test_consensus_prefers_the_wording_that_overlaps_with_all_others():
    samples = ["a man walk forward", "a person walk forward", "a person run forward", "a person walk forward slowly"]
    ranked = consensus([*samples, "jump", "jump"], samples)
    assert ranked[0] == "a person walk forward"
    assert ranked[-1] == "jump"
    assert len(ranked) == 5
    assert consensus(["jump"], ["", "walk"]) == ["jump"]


def test_agreement_is_smoothed_bleu_of_one_sentence():
    found = agreement(["walk walk", "walk", "a man walk on"], ["walk", "walk walk", "a man walk on"])
    # One match of two words, and nothing longer: 1/2 and three times (0 + 1) / (1 + 1). Shorter: e^(1 - 2/1) besides.
    np.testing.assert_allclose(found[0, 0], 0.5)
    np.testing.assert_allclose(found[1, 1], 0.5**0.75 * np.exp(-1))
    np.testing.assert_allclose(found[1, 0], 0.5**0.75)
    np.testing.assert_allclose(found[2, 2], 1)
    # A word that both say twice counts twice: 2/2, one pair (1 + 1) / (1 + 1), nothing longer.
    np.testing.assert_allclose(found[0, 1], 0.5**0.5)


def test_bad_motions_are_named(context):
    with pytest.raises(InputError, match=r"features\[1\]"):
        captioner(context).caption([np.zeros((8, DIM), np.float32), np.zeros((8, 7), np.float32)])
    with pytest.raises(InputError, match="heads"):
        model(context, width=33)
    with pytest.raises(InputError, match=r"motion2text.ensemble: 0: must be at least 1"):
        member_seeds(0, 0)


@pytest.mark.parametrize("tokens", [True, False])
def test_one_batch_is_learned_by_heart(context, tokens, tmp_path):
    net, batch = model(context, tokens=tokens), a_batch(context, items=6, motion=True)
    optimizer = torch.optim.Adam(net.parameters(), 5e-3)
    for _ in range(80):
        loss, _ = net.loss(batch, 0.0, torch.Generator())
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert loss.item() < 0.02
    save_model(tmp_path / "motion2text", "motion2text", net, context)
    again = load_model(tmp_path / "motion2text")
    source, mask = again.source_of(batch)
    found = beam_search(again, again.start(source, mask), torch.full((6,), START), END, 2, 1, 8)
    for row, hypotheses in enumerate(found):
        assert hypotheses[0].tokens == batch.words[row, 1 : batch.word_count[row] - 1].tolist()


@pytest.mark.parametrize("code_dim", [6, 48])
def test_embeddings_may_start_as_the_codebook(context, tmp_path, code_dim):
    with seeded(3):
        tokenizer = Tokenizer(TokenizerConfig(codebook_size=200, code_dim=code_dim, width=16, fine_width=16), context)
        tokenizer.quantizer.codebook.normal_()
    save_model(tmp_path / "tokenizer", "tokenizer", tokenizer, context)
    settings = {"width": 256, "num_heads": 4, "num_layers": 1, "dim_feedforward": 8}
    with seeded(1):
        started = build_model("motion2text", {**settings, "start_from_codebook": True}, context, Trained(tmp_path))
    with seeded(1):
        plain = build_model("motion2text", settings, context, Trained(tmp_path))
    codes = started.source.weight[:200].detach()
    assert abs(codes.std().item() - 1) < 1e-3
    # A random projection to many dimensions keeps distances, up to scale.
    near = torch.corrcoef(torch.stack([torch.pdist(codes), torch.pdist(tokenizer.quantizer.codebook)]))[0, 1]
    assert near > 0.7
    assert torch.equal(started.source.weight[200:], plain.source.weight[200:])
    assert torch.equal(started.words.weight, plain.words.weight)


def build_members(settings, context, folder, seeds):
    """A fresh member for each seed, by the name of its folder, as the stage builds them."""
    members = {}
    for number, seed in enumerate(seeds):
        with seeded(seed):
            members[member_name(number)] = build_model("motion2text", settings, context, Trained(folder))
    return members


def test_members_are_trained_from_seeds_of_their_own_and_open_together(context, tmp_path):
    with seeded(3):
        tokenizer = Tokenizer(TokenizerConfig(codebook_size=CODES, code_dim=8, width=16, fine_width=16), context)
    save_model(tmp_path / "tokenizer", "tokenizer", tokenizer, context)
    settings = {"width": 32, "num_heads": 4, "num_layers": 1, "dim_feedforward": 8, "ensemble": 3}
    members = build_members(settings, context, tmp_path, member_seeds(5, 3))
    weights = [member.words.weight for member in members.values()]
    assert len({float(weight.detach().sum()) for weight in weights}) == 3
    alone = build_members({**settings, "ensemble": 1}, context, tmp_path, member_seeds(5, 1))
    assert torch.equal(weights[0], alone[""].words.weight)
    for name, member in members.items():
        save_model(tmp_path / "motion2text" / name, "motion2text", member, context)
    opened = open_system("motion2text", "motion_to_text", tmp_path)
    assert [torch.equal(a.words.weight, b) for a, b in zip(opened.members, weights, strict=True)] == [True] * 3
