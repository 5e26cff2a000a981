"""Training clips as examples: the nearest captions, never the own recording, a part of the weights, told texts only."""

from __future__ import annotations

import pytest
import torch
from every_system import batch_for

from motionary.corpus.batches import TokenStore
from motionary.corpus.preprocess import preprocess
from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.language import TextStates
from motionary.nn.layers import seeded
from motionary.systems.io import load_model, save_model
from motionary.systems.masked.examples import POOL, ExampleBank, Examples
from motionary.systems.masked.masked_generator import MaskedGenerator, MaskedGeneratorConfig
from motionary.systems.masked.masked_networks import Text

SMALL = dict(word_dim=8, width=32, num_layers=1, detail_layers=1, num_heads=4, dim_feedforward=64, dropout=0.0)


@pytest.fixture(scope="module")
def corpus(tmp_path_factory) -> Corpus:
    folder = tmp_path_factory.mktemp("corpus")
    preprocess({"clips": 30, "workers": 1, "mirror": True, "ratios": [0.8, 0.1, 0.1]}, folder, progress=False)
    return Corpus.open(folder)


@pytest.fixture(scope="module")
def states() -> TextStates:
    return TextStates()


@pytest.fixture(scope="module")
def bank(corpus, states) -> ExampleBank:
    """Each clip's tokens are the number of its row."""
    return ExampleBank().take(corpus, stored(corpus), states)


def stored(corpus: Corpus) -> TokenStore:
    return TokenStore.collect(
        [torch.full((int(length) // 4, 3), row).numpy() for row, length in enumerate(corpus.clips.length)]
    )


def read(states: TextStates, *texts: str) -> tuple[torch.Tensor, torch.Tensor]:
    found, count = states(texts)
    return torch.from_numpy(found), torch.from_numpy(count)


def drawn(bank: ExampleBank, states: TextStates, text: str, seed: int = 0, wanted: int = 2, row: int | None = None):
    """Rows of the corpus."""
    noise = torch.rand(1, POOL, generator=torch.Generator().manual_seed(seed))
    rows = None if row is None else torch.tensor([row])
    found = bank.draw(wanted, *read(states, text), noise, rows)
    assert found.codes.shape[:2] == found.count.shape == (1, wanted)
    return found.codes[0, :, 0].tolist()


def test_a_training_caption_finds_its_own_clip_and_training_never_does(bank, corpus, states):
    for row in corpus.rows("train", True)[::7]:
        text = str(corpus.captions.text[corpus.caption_start[row]])
        assert row in drawn(bank, states, text, wanted=POOL)
        others = drawn(bank, states, text, wanted=POOL, row=int(row))
        origins = set(corpus.clips.origin[others])
        assert corpus.clips.origin[row] not in origins, "nor a mirrored copy, nor another window of it"
        assert set(corpus.clips.split[others]) == {"train"}


def test_seeds_draw_among_the_nearest(bank, states):
    pool = drawn(bank, states, "a person waves", wanted=POOL)
    rows = [tuple(drawn(bank, states, "a person waves", seed)) for seed in range(12)]
    assert len(set(rows)) > 3
    assert {row for pair in rows for row in pair} <= set(pool)
    assert all(len(set(pair)) == 2 for pair in rows)
    assert rows[0] == tuple(drawn(bank, states, "a person waves", 0))


def test_clips_count_as_long_as_they_are(bank, corpus, states):
    found = bank.draw(POOL, *read(states, "a person walks"), torch.rand(1, POOL))
    assert found.count[0].tolist() == (corpus.clips.length[found.codes[0, :, 0]] // 4).tolist()


def model(context, **settings) -> MaskedGenerator:
    with seeded(0):
        config = MaskedGeneratorConfig(256, 8, 3, **{**SMALL, "examples": 2, **settings})
        return MaskedGenerator(config, context).take_codebooks(torch.randn(3, 256, 8)).eval()


def test_the_bank_is_a_part_of_the_weights(corpus, states, tmp_path):
    net = model(corpus.context)
    net.bank.take(corpus, stored(corpus), states)
    save_model(tmp_path / "masked_generator", "masked_generator", net, corpus.context)
    again = load_model(tmp_path / "masked_generator")
    told, noise = read(states, "a person jumps", "a person waves"), torch.rand(2, POOL)
    for mine, theirs in zip(net.examples(*told, noise), again.examples(*told, noise), strict=True):
        assert torch.equal(mine, theirs)
    loss, _ = net.train().loss(batch_for(corpus.context, net), 0.0, torch.Generator().manual_seed(0))
    loss.backward()
    assert float(net.text.examples.weight.grad.abs().sum()) > 0


def test_only_texts_that_are_told_look_at_examples_and_padding_is_not_seen(context):
    net = model(context)
    batch = batch_for(context, net)
    count = torch.tensor([[3, 2]] * 6)
    codes = torch.randint(256, (6, 2, 3), generator=torch.Generator().manual_seed(0))
    told = (batch.words, batch.tags, batch.word_count, batch.states, batch.state_count)

    def logits(codes: torch.Tensor, blank: bool) -> torch.Tensor:
        memory = net.text(Text(*told, Examples(codes, count)), torch.full((6,), blank))
        return net.plan(batch.tokens[..., 0], batch.token_count, memory, net.plan.reader.read(memory))

    first, padding = codes.clone(), codes.clone()
    first[:, 0, 0] += 1
    first %= 256
    padding[:, 1, 2] = 7
    assert (logits(codes, False) - logits(first, False)).abs().amax((1, 2)).min() > 1e-6
    torch.testing.assert_close(logits(codes, True), logits(first, True))
    torch.testing.assert_close(logits(codes, False), logits(padding, False))


def test_what_examples_say_is_learned(corpus, states):
    """Tokens that no text tells, and an example does."""
    net = model(corpus.context, text_dropout=0.0, guidance=1.0, detail_guidance=1.0, examples=1, label_smoothing=0.0)
    net.train()
    optimizer = torch.optim.AdamW(net.parameters(), lr=3e-3)
    rng, batch = torch.Generator().manual_seed(0), batch_for(corpus.context, net)
    nothing, all_hidden = torch.zeros(6, dtype=torch.bool), torch.full((6, 8), 256)
    told = (batch.words, batch.tags, batch.word_count, batch.states * 0, batch.state_count)

    def loss() -> tuple[torch.Tensor, float]:
        codes = torch.randint(16, (6, 1, 1), generator=rng).expand(6, 1, 8)
        memory = net.text(Text(*told, Examples(codes, batch.token_count[:, None])), nothing)
        logits = net.plan(all_hidden, batch.token_count, memory, net.plan.reader.read(memory))
        valid = torch.arange(8) < batch.token_count[:, None]
        wanted = codes[:, 0][valid]
        right = (logits[valid].argmax(-1) == wanted).float().mean()
        return torch.nn.functional.cross_entropy(logits[valid], wanted), float(right)

    for _ in range(200):
        loss()[0].backward()
        optimizer.step()
        optimizer.zero_grad()
    assert sum(loss()[1] for _ in range(10)) / 10 > 0.9, "codes drawn anew each time, so nothing is known by heart"


def test_too_many_are_refused():
    with pytest.raises(InputError, match=r"masked_generator\.examples: 9: must be in 0\.\.8"):
        MaskedGeneratorConfig(16, 8, examples=9)
