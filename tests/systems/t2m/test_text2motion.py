"""The temporal VAE: closed forms of Eq. 4.4-4.6, gradients, curriculum, masks, switches, independence of the batch."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from motionary.corpus.batches import Batch
from motionary.errors import InputError
from motionary.language import Sentence
from motionary.nn.gaussian import Gaussian, divergence
from motionary.nn.layers import seeded
from motionary.nn.noise import normal_noise
from motionary.systems.io import Trained, build_model, load_model, open_system, save_model
from motionary.systems.t2m.autoencoder import Autoencoder, AutoencoderConfig
from motionary.systems.t2m.curriculum import Curriculum
from motionary.systems.t2m.motion_generator import MotionGenerator
from motionary.systems.t2m.temporal_vae import time_to_arrival
from motionary.systems.t2m.text2length import Lengths, Text2Length, Text2LengthConfig
from motionary.systems.t2m.text2motion import Text2Motion, Text2MotionConfig
from motionary.training.devices import make_fabric
from motionary.training.loop import fit
from motionary.training.settings import TrainSettings

SMALL = {
    "word_dim": 12, "text_width": 12, "width": 24, "attention_width": 16, "latent": 6, "curriculum_start": 49,
}  # fmt: skip
SWITCHES = ("snippets", "attention", "tags", "positions")


def autoencoder(context) -> Autoencoder:
    with seeded(1):
        return Autoencoder(AutoencoderConfig(width=16, code_dim=12), context).eval()


def model(context, **settings) -> Text2Motion:
    upstream = autoencoder(context)
    with seeded(0):
        config = Text2MotionConfig(**{**SMALL, **settings}, **upstream.config.as_upstream())
        return Text2Motion(config, context).take_snippets(upstream.encoder, upstream.decoder).eval()


def generator(context, **settings) -> MotionGenerator:
    with seeded(2):
        lengths = Lengths(Text2Length(Text2LengthConfig(word_dim=8, text_width=8), context))
    return MotionGenerator(model(context, **settings), lengths.sample, chunk=3)


def sentences(context) -> list[Sentence]:
    words = context.vocabulary.words[4:]
    return [Sentence("", words[:n], ("NOUN",) * n) for n in (1, 3, 7, 2, 5, 0, 4)]


def changed(batch: Batch, **fields: torch.Tensor) -> Batch:
    return Batch(**{**vars(batch), **fields})


def losses(net: Text2Motion, batch, teacher_forcing: bool = False) -> dict[str, torch.Tensor]:
    forced = torch.full((len(batch.clip),), teacher_forcing)
    return net._loss(batch, batch.words, forced, torch.Generator().manual_seed(0))[1]


def test_the_divergence_is_the_closed_form():
    rng = torch.Generator().manual_seed(0)
    q, p = (Gaussian(*torch.randn(2, 4, 3, generator=rng).double().unbind(0)) for _ in range(2))
    normal = [torch.distributions.Normal(g.mean, torch.exp(0.5 * g.log_variance)) for g in (q, p)]
    expected = torch.distributions.kl_divergence(*normal).sum(-1)
    assert torch.allclose(divergence(q, p), expected)
    assert torch.allclose(divergence(q, q), torch.zeros(4).double(), atol=1e-12)
    # One dimension by hand: KL(N(1, 4) || N(0, 1)) = 0.5 (4 + 1 - 1 - ln 4)
    one = divergence(Gaussian(torch.ones(1), torch.full((1,), math.log(4))), Gaussian(torch.zeros(1), torch.zeros(1)))
    assert one.item() == pytest.approx(0.5 * (4 - math.log(4)))


def test_the_time_to_arrival_is_that_of_equation_4_5():
    encoded = time_to_arrival(torch.tensor([5, 2]), 5, 8)
    assert encoded.shape == (2, 5, 8)
    for row, length in enumerate((5, 2)):
        for step in range(1, 6):
            left = max(length - step, 0)
            for i in range(4):
                angle = left / 10000 ** (2 * i / 8)
                assert encoded[row, step - 1, 2 * i].item() == pytest.approx(math.sin(angle), abs=1e-6)
                assert encoded[row, step - 1, 2 * i + 1].item() == pytest.approx(math.cos(angle), abs=1e-6)


@torch.no_grad()
def test_attention_is_that_of_equation_4_4_and_padding_has_no_part(context, batch):
    net = model(context).net
    words, hidden = net.start(batch.words, batch.tags, batch.word_count)
    attended = words.attend(net.query(hidden[2]))
    for row in range(4):
        n = int(batch.word_count[row])
        memory, _ = net.text(batch.words[row : row + 1, :n], batch.tags[row : row + 1, :n], batch.word_count[row, None])
        query, keys, values = net.query(hidden[2][row]), net.key(memory[0]), net.value(memory[0])
        weights = torch.softmax(keys @ query / 16**0.5, dim=0)
        assert torch.allclose(attended[row], weights @ values, atol=1e-5)


def test_only_the_decoder_learns_slowly_and_the_encoder_not_at_all(context, batch):
    net = model(context)
    net.train()
    net.loss(batch, 0.0, torch.Generator().manual_seed(0))[0].backward()
    assert all(p.grad is None and not p.requires_grad for p in net.encoder.parameters())
    assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in net.decoder.parameters())
    silent = {name for name, p in net.net.named_parameters() if p.grad is None or not p.grad.abs().sum() > 0}
    assert silent == set()
    groups = net.parameter_groups(2e-4)
    rates = {id(p): group["lr"] for group in groups for p in group["params"]}
    assert all(rates[id(p)] == pytest.approx(2e-5) for p in net.decoder.parameters())
    assert all(rates[id(p)] == pytest.approx(2e-4) for p in net.net.parameters())
    assert not any(id(p) in rates for p in net.encoder.parameters())
    assert len(model(context, decoder_rate=0.0).parameter_groups(1e-3)) == 1


def test_the_motion_term_reaches_the_codes_and_each_term_has_its_weight(context, batch):
    values = {}
    for name, settings in {
        "all": {"motion_weight": 2.0, "kl_weight": 0.5}, "code": {"motion_weight": 0.0, "kl_weight": 0.0},
    }.items():  # fmt: skip
        net = model(context, **settings)
        loss, logs = net._loss(batch, batch.words, torch.zeros(4, dtype=torch.bool), torch.Generator().manual_seed(0))
        values[name] = (loss.item(), {k: v.item() for k, v in logs.items()})
    total, parts = values["all"]
    assert total == pytest.approx(parts["code"] + 2 * parts["motion"] + 0.5 * parts["kl"], rel=1e-5)
    assert parts["reconstruction"] == pytest.approx(parts["code"] + 2 * parts["motion"], rel=1e-5)
    assert values["code"][0] == pytest.approx(parts["code"], rel=1e-5)


@torch.no_grad()
def test_padding_and_neighbors_change_nothing(context, batch, batches):
    net = model(context)
    length = batch.frames // 4
    noise = torch.randn(4, 8, 6, generator=torch.Generator().manual_seed(0))
    targets = net.encode(batch.motion, batch.frames)

    def run(rows, words, steps, targets):
        sentence, hidden = net.net.start(batch.words[rows, :words], batch.tags[rows, :words], batch.word_count[rows])
        forced = torch.zeros(len(length[rows]), dtype=torch.bool)
        return net.net.unroll(
            sentence, hidden, targets[:, :steps], net.first, length[rows], forced, noise[rows, :steps]
        )

    together = run(slice(0, 4), 9, 8, targets)
    for row in range(4):
        n, rows = int(length[row]), slice(row, row + 1)
        alone_targets = net.encode(batch.motion[rows, : 4 * n], batch.frames[rows])
        alone = run(rows, int(batch.word_count[row]), n, alone_targets)
        assert torch.allclose(alone.codes[0], together.codes[row, :n], atol=1e-5)
        assert torch.allclose(alone.prior.mean[0], together.prior.mean[row, :n], atol=1e-5)
        assert torch.allclose(alone.posterior.mean[0], together.posterior.mean[row, :n], atol=1e-5)
    spoiled = changed(batch, motion=batch.motion.clone())
    for row in range(4):
        spoiled.motion[row, int(batch.frames[row]) :] = 100.0
    for name, value in losses(net, batch).items():
        assert losses(net, spoiled)[name].item() == pytest.approx(value.item(), rel=1e-4), name


@torch.no_grad()
def test_the_prior_is_blind_to_the_current_code_and_forced_rows_read_the_true_ones(context, batch):
    net, length = model(context), batch.frames // 4
    targets, noise = net.encode(batch.motion, batch.frames), torch.zeros(4, 8, 6)
    changed = targets.clone()
    changed[:, 2] += 1.0

    def run(codes, forced):
        return net.net.unroll(
            *net.net.start(batch.words, batch.tags, batch.word_count), codes, net.first, length,
            torch.tensor(forced), noise,
        )  # fmt: skip

    before, after = run(targets, [True] * 4), run(changed, [True] * 4)
    assert torch.allclose(before.prior.mean[:, :3], after.prior.mean[:, :3])
    assert not torch.allclose(before.prior.mean[:, 3], after.prior.mean[:, 3])
    assert torch.allclose(before.posterior.mean[:, :2], after.posterior.mean[:, :2])
    assert not torch.allclose(before.posterior.mean[:, 2], after.posterior.mean[:, 2])
    free, mixed = run(targets, [False] * 4), run(targets, [True, False, True, False])
    assert torch.allclose(mixed.codes[::2], before.codes[::2], atol=1e-6)
    assert torch.allclose(mixed.codes[1::2], free.codes[1::2], atol=1e-6)
    assert torch.allclose(free.codes[:, 0], before.codes[:, 0])
    assert not torch.allclose(free.codes[:, 1:], before.codes[:, 1:], atol=1e-4)


def test_coins_are_tossed_for_every_sequence(context, batches):
    net, seen = model(context, teacher_forcing=0.4), []
    net._loss = lambda batch, words, forced, generator: seen.append(forced)  # type: ignore[method-assign,assignment]
    net.loss(batches(context, [8] * 300), 0.0, torch.Generator().manual_seed(0))
    assert 0.3 < seen[0].float().mean() < 0.5


def test_the_curriculum_moves_when_the_reconstruction_rises_or_its_patience_ends():
    stages = Curriculum(start=8, add=3, most=16, patience=4)
    for value, expected in ((1.0, 8), (0.9, 8), (0.95, 11), (2.0, 11), (1.9, 11), (1.8, 11), (1.7, 14), (3, 14)):
        stages.observe(value)
        assert stages.length == expected
    stages.observe(4.0)
    assert stages.length == 16
    stages.observe(5.0)
    stages.observe(6.0)
    assert stages.length == 16
    even = Curriculum(start=8, add=1, most=48, patience=9)
    for part, expected in ((0.0, 8), (0.5, 28), (0.25, 28), (2.0, 48)):
        even.at_least(part)
        assert even.length == expected
    assert Curriculum(60, 1, 49, 1).length == 49


def test_a_stage_trains_on_the_first_codes_only_and_knows_when_the_whole_arrives(context, batch):
    net = model(context, curriculum_start=3)
    other = changed(batch, motion=batch.motion.clone())
    other.motion[:, 20:] += 1.0  # beyond what three codes and the encoder's view of their neighbors hold
    assert losses(net, batch)["reconstruction"].item() == pytest.approx(losses(net, other)["reconstruction"].item())
    shorter = changed(batch, frames=torch.full((4,), 16))
    assert losses(net, batch)["kl"].item() != pytest.approx(losses(net, shorter)["kl"].item(), rel=1e-6)
    net.loss(batch, 0.6, torch.Generator())
    assert net.curriculum.length == 3
    timed = model(context, curriculum_start=3, curriculum_share=0.5)
    timed.loss(batch, 0.6, torch.Generator())
    assert timed.curriculum.length == 49


class Few:
    """A dataset of one batch's items, for the loop."""

    def __init__(self, batch):
        self.batch, self.lengths, self.weights = batch, batch.frames.numpy(), None

    def __len__(self):
        return len(self.lengths)

    def collate(self, indices, rng):
        fields = {k: v[indices] for k, v in vars(self.batch).items() if v is not None}
        return type(self.batch)(**fields)


def test_a_resumed_training_stands_in_the_same_stage(context, batch, tmp_path):
    from motionary.corpus.batches import Batches

    settings = TrainSettings(steps=8, batch_size=2, learning_rate=1e-3, validate_every=1, max_grad_norm=0.5)
    changes = {"curriculum_start": 2, "curriculum_patience": 2, "dropout": 0.2, "word_dropout": 0.1}
    trained = []
    for stops in ([None], [3, 6, None]):
        path = tmp_path / f"{len(stops)}.safetensors"
        for stop in stops:
            net = model(context, **changes)
            data = Batches(Few(batch), 2, drop_last=True), Batches(Few(batch), 4, shuffle=False)
            fit(net, *data, settings, make_fabric("cpu"), path, stop_after=stop)
        trained.append(net)
    whole, resumed = trained
    assert whole.curriculum.length > 4
    for name, value in whole.state_dict().items():
        assert torch.equal(value, resumed.state_dict()[name]), name


def test_one_batch_is_learned_by_heart(context, batches):
    batch = batches(context, [16, 12, 16])
    net = model(context, width=48, text_width=24)
    optimizer = torch.optim.Adam(net.parameter_groups(1e-2))
    before = losses(net, batch)["code"].item()
    for step in range(90):
        loss, _ = net.loss(batch, 0.0, torch.Generator().manual_seed(step))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert losses(net, batch)["code"].item() < 0.25 * before
    codes, length = net.encode(batch.motion, batch.frames), batch.frames // 4
    order = torch.tensor([0, 2, 1])
    words = net.net.start(batch.words[order], batch.tags[order], batch.word_count[order])
    made = net.net.generate(*words, net.first, length[order], torch.zeros(3, 4, 6))
    assert (made - codes[order]).abs().mean() < 0.4 * codes.abs().mean()


@pytest.mark.parametrize("switch", SWITCHES)
def test_each_switch_of_table_4_4_changes_what_it_should(context, batch, switch):
    on, off = model(context), model(context, **{switch: False})
    names = {name for name, _ in on.named_parameters()} - {name for name, _ in off.named_parameters()}
    gone = {"snippets": "decoder.", "attention": "net.key.", "tags": "net.text.embedding.tags.", "positions": None}
    assert any(name.startswith(gone[switch]) for name in names) if gone[switch] else not names
    loss, logs = off.loss(batch, 0.0, torch.Generator().manual_seed(0))
    loss.backward()
    assert torch.isfinite(loss)
    assert ("motion" in logs) == (switch != "snippets")
    retagged = changed(batch, tags=(batch.tags + 1) % 15)
    assert (losses(off, retagged)["code"] == losses(off, batch)["code"]).item() == (switch == "tags")
    made, texts = MotionGenerator(off, generator(context).lengths), sentences(context)
    short, long = (made.generate(texts, range(7), [f] * 7, greedy=True) for f in (8, 24))
    blind = all(np.allclose(a, b[:8], atol=1e-5) for a, b in zip(short, long, strict=True))
    assert [m.shape for m in short] == [(8, 263)] * 7
    if switch == "positions":  # the last of the decoder's frames feel the end of the codes
        assert all(np.allclose(a[:4], b[:4], atol=1e-4) for a, b in zip(short, long, strict=True))
    else:
        assert not blind


@pytest.mark.parametrize("settings", [{}, {"snippets": False}, {"attention": False}])
def test_motions_do_not_depend_on_the_batch(context, settings):
    made = generator(context, **settings)
    texts, seeds = sentences(context), [7, 8, 9, 10, 11, 12, 13]
    for options in ({}, {"temperature": 0.5}, {"greedy": True}, {"top_k": 3}):
        together = made.generate(texts, seeds, **options)
        assert all(len(m) % 4 == 0 and 4 <= len(m) <= 196 and m.dtype == np.float32 for m in together)
        for i in (0, 2, 5):
            alone = made.generate([texts[i]], [seeds[i]], **options)[0]
            assert alone.shape == together[i].shape
            assert np.allclose(alone, together[i], atol=1e-4)
    assert made.generate([], []) == []
    several = made.generate([texts[1]] * 6, range(6), [40] * 6)
    assert all(np.abs(several[0] - other).max() > 1e-3 for other in several[1:])
    longer = normal_noise([3, 4], 9, 6)
    assert torch.equal(longer[:, :4], normal_noise([3, 4], 4, 6))


def test_lengths_are_held_where_given_as_by_every_system(context):
    made, wanted = generator(context), [4, 5, 18, 196, 33, 40, 7]
    motions = made.generate(sentences(context), range(7), wanted)
    assert [len(motion) for motion in motions] == wanted
    with pytest.raises(InputError, match="temperature"):
        made.generate(sentences(context), range(7), temperature=0)


def test_it_starts_from_the_autoencoder_and_stands_alone_afterwards(context, batch, tmp_path):
    upstream = autoencoder(context)
    save_model(tmp_path / "autoencoder", "autoencoder", upstream, context)
    net = build_model("text2motion", SMALL, context, Trained(tmp_path))
    codes = net.encode(batch.motion, batch.frames)
    assert torch.equal(codes, upstream.encode(batch.motion, batch.frames))
    count = batch.frames // 4
    assert torch.allclose(net.decode(codes, count), upstream.decode(codes, count))
    pose = torch.from_numpy(context.mean).expand(1, 4, -1)
    assert torch.allclose(net.first, upstream.encode(pose)[0, 0])
    with seeded(0):
        lengths = Text2Length(Text2LengthConfig(word_dim=8, text_width=8), context)
    save_model(tmp_path / "text2motion", "text2motion", net, context)
    save_model(tmp_path / "text2length", "text2length", lengths, context)
    again = load_model(tmp_path / "text2motion")
    assert all(torch.equal(value, again.state_dict()[name]) for name, value in net.state_dict().items())
    opened = open_system("text2motion", "text_to_motion", tmp_path)
    texts = sentences(context)
    made = [m.tobytes() for m in opened.generate(texts, range(7))]
    assert made == [m.tobytes() for m in MotionGenerator(net, Lengths(lengths).sample).generate(texts, range(7))]


def test_bad_settings_say_what_is_wrong():
    for name, value in (
        ("teacher_forcing", 1.5), ("curriculum_start", 0), ("kl_weight", -1.0), ("curriculum_share", 2.0),
    ):  # fmt: skip
        with pytest.raises(InputError, match=name):
            Text2MotionConfig(**{name: value})
