"""TEMOS: closed forms of Eq. 1-3, masks, every switch of its tables, one batch learned by heart, saving and opening."""

from __future__ import annotations

import numpy as np
import pytest
import torch
import torch.nn.functional as F

from motionary.corpus.batch import Batch
from motionary.errors import InputError
from motionary.language import Sentence
from motionary.nn.gaussian import Gaussian, divergence
from motionary.nn.layers import seeded
from motionary.systems.io import load_model, save_model
from motionary.systems.temos.sequences import SequenceDecoder
from motionary.systems.temos.temos import Temos, TemosConfig, kl_terms, smooth_l1
from motionary.systems.temos.temos_generator import TemosGenerator

SMALL = {"latent": 16, "num_layers": 2, "num_heads": 2, "dim_feedforward": 24, "dropout": 0.0, "text_dim": 12}
SWITCHES = {
    "deterministic": {"deterministic": True},
    "gru": {"architecture": "gru"},
    "no motion encoder": {"motion_encoder": False},
    "no cross KL": {"cross_kl": False},
    "no priors": {"prior_kl": False},
    "no embedding loss": {"embedding_weight": 0.0},
}


def model(context, **settings) -> Temos:
    with seeded(0):
        return Temos(TemosConfig(**{**SMALL, **settings}), context)


def described(net: Temos, frames=(12, 9, 5, 11), words=(7, 4, 6, 3)) -> Batch:
    """Smooth features and random states of the given lengths, zero beyond them."""
    rng = np.random.default_rng(0)
    dim, size, states = net.codec.dim, len(frames), np.zeros((len(words), max(words), 12), np.float32)
    phase = rng.uniform(0, 6, (size, 1, dim)) + np.arange(max(frames))[:, None] * rng.uniform(0.1, 0.5, (size, 1, dim))
    motion = np.sin(phase).astype(np.float32)
    for row, (long, count) in enumerate(zip(frames, words, strict=True)):
        motion[row, long:] = 0
        states[row, :count] = rng.normal(size=(count, 12))
    return Batch(
        clip=torch.arange(size), motion=torch.from_numpy(motion), frames=torch.tensor(frames),
        states=torch.from_numpy(states), state_count=torch.tensor(words),
    )  # fmt: skip


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def test_equation_1_is_the_mean_over_valid_frames():
    made, target = torch.randn(2, 5, 3, generator=generator()), torch.zeros(2, 5, 3)
    made = 3 * made
    valid = torch.tensor([[True] * 5, [True] * 2 + [False] * 3])
    kept = torch.cat([made[0], made[1, :2]]).abs()
    by_hand = torch.where(kept < 1, 0.5 * kept.square(), kept - 0.5).mean()
    assert torch.allclose(smooth_l1(made, target, valid), by_hand)


def test_equation_2_has_four_terms():
    rng = generator()
    text, motion = (Gaussian(*torch.randn(2, 4, 3, generator=rng).double().unbind(0)) for _ in range(2))
    normal = Gaussian(torch.zeros(4, 3).double(), torch.zeros(4, 3).double())

    def kl(a, b):
        left, right = (torch.distributions.Normal(g.mean, (0.5 * g.log_variance).exp()) for g in (a, b))
        return torch.distributions.kl_divergence(left, right).sum(-1).mean()

    between, priors = kl(text, motion) + kl(motion, text), kl(text, normal) + kl(motion, normal)
    assert torch.allclose(kl_terms(text, motion), between + priors)
    assert torch.allclose(kl_terms(text, motion, prior=False), between)
    assert torch.allclose(kl_terms(text, motion, cross=False), priors)
    assert torch.allclose(kl_terms(text, None), kl(text, normal))


def test_the_loss_is_the_weighted_sum_of_equations_1_to_3(context):
    net = model(context, kl_weight=0.3, embedding_weight=2.0).eval()
    batch = described(net)
    loss, terms = net.loss(batch, 0.0, generator(5))
    weighted = terms["text"] + terms["motion"] + 0.3 * terms["kl"] + 2.0 * terms["embedding"]
    assert torch.allclose(loss, weighted)
    # Each term from its parts, with the same draws: first the text's, then the motion's.
    noise = generator(5)
    text, motion = net.encode_text(batch.states, batch.state_count), net.encode_motion(batch.motion, batch.frames)
    latents = [branch.sample(torch.randn(4, 16, generator=noise)) for branch in (text, motion)]
    assert torch.allclose(terms["embedding"], F.smooth_l1_loss(*latents))
    for name, z in zip(("text", "motion"), latents, strict=True):
        made, total, count = net.decode(z, batch.frames), 0.0, 0
        for row, frames in enumerate(batch.frames.tolist()):
            part = F.smooth_l1_loss(made[row, :frames], batch.motion[row, :frames], reduction="none")
            total, count = total + part.mean(-1).sum(), count + frames
        assert torch.allclose(terms[name], total / count, atol=1e-6)


@pytest.mark.parametrize("switch", ["transformer", "gru"])
@torch.no_grad()
def test_padding_and_neighbours_change_nothing(context, switch):
    net = model(context, architecture=switch).eval()
    batch = described(net)
    text, motion = net.encode_text(batch.states, batch.state_count), net.encode_motion(batch.motion, batch.frames)
    made = net.decode(motion.mean, batch.frames)
    for row in range(4):
        rows, frames, words = slice(row, row + 1), int(batch.frames[row]), int(batch.state_count[row])
        alone = net.encode_motion(batch.motion[rows, :frames], batch.frames[rows])
        assert torch.allclose(alone.mean, motion.mean[rows], atol=1e-5)
        assert torch.allclose(alone.log_variance, motion.log_variance[rows], atol=1e-5)
        said = net.encode_text(batch.states[rows, :words], batch.state_count[rows])
        assert torch.allclose(said.mean, text.mean[rows], atol=1e-5)
        assert torch.allclose(net.decode(alone.mean, batch.frames[rows])[0], made[row, :frames], atol=1e-5)
        assert not made[row, frames:].any()


def test_one_latent_as_memory_makes_attention_a_linear_layer():
    """What the decoder's layers rest on: torch's own attention on a memory of one, whatever asks."""
    attention = torch.nn.MultiheadAttention(16, 4, batch_first=True)
    z = torch.randn(3, 1, 16, generator=generator())
    query = torch.randn(3, 7, 16, generator=generator(1))
    value = F.linear(z, attention.in_proj_weight[32:], attention.in_proj_bias[32:])
    assert torch.allclose(attention(query, z, z)[0], attention.out_proj(value).expand(-1, 7, -1), atol=1e-6)


@torch.no_grad()
def test_the_decoder_sees_all_frames_at_once_and_any_duration():
    net = SequenceDecoder(5, 16, 2, 2, 24, 0.0).eval()
    z = torch.randn(1, 16, generator=generator())
    short, long = net(z, torch.tensor([6])), net(z, torch.tensor([40]))
    assert (short.shape, long.shape) == ((1, 6, 5), (1, 40, 5))
    assert not torch.allclose(short, long[:, :6], atol=1e-3)  # frames attend to those that follow


@pytest.mark.parametrize("switch", SWITCHES)
def test_every_switch_trains_and_changes_what_it_names(context, switch):
    net = model(context, **SWITCHES[switch])
    batch = described(net)
    _, terms = net.loss(batch, 0.0, generator())
    names = {"text", "motion", "kl", "embedding"}
    names -= {"deterministic": {"kl"}, "no motion encoder": {"motion", "embedding"}}.get(switch, set())
    assert terms.keys() == names
    optimizer = torch.optim.AdamW(net.parameters(), lr=5e-3)
    values = []
    for step in range(60):
        loss, terms = net.loss(batch, 0.0, generator(step))
        loss.backward()
        assert all(p.grad is not None for p in net.parameters() if p.requires_grad) or switch != "gru"
        optimizer.step()
        optimizer.zero_grad()
        values.append(float(terms["text"]))
    assert np.mean(values[-10:]) < 0.7 * np.mean(values[:5])


def gradient_of(net: Temos, batch: Batch, part: str) -> float:
    net.zero_grad()
    net.loss(batch, 0.0, generator())[0].backward()
    return sum(
        float(p.grad.abs().sum()) for n, p in net.named_parameters() if n.startswith(part) and p.grad is not None
    )


def test_switches_remove_exactly_their_terms(context):
    batch = described(model(context))
    heavy = {"kl_weight": 1.0, "embedding_weight": 1.0}
    with_all = model(context, **heavy).eval().loss(batch, 0.0, generator())[0].item()
    parts = model(context, **heavy).eval().loss(batch, 0.0, generator())[1]
    for settings in ({"cross_kl": False}, {"prior_kl": False}, {"embedding_weight": 0.0}):
        loss, terms = model(context, **{**heavy, **settings}).eval().loss(batch, 0.0, generator())
        weight = settings.get("embedding_weight", 1.0)
        rest = terms["text"] + terms["motion"] + terms["kl"] + weight * terms["embedding"]
        assert loss.item() == pytest.approx(rest.item(), rel=1e-5)
        assert loss.item() < with_all
        assert torch.allclose(terms["text"], parts["text"])  # and nothing else
    plain = model(context, deterministic=True).eval()
    assert plain.loss(batch, 0.0, generator(1))[0].item() == plain.loss(batch, 0.0, generator(2))[0].item()
    assert gradient_of(model(context), batch, "motion.") > 0
    assert model(context, motion_encoder=False).motion is None


def test_one_batch_is_learned_by_heart_from_both_sides(context):
    net = model(context, latent=32, dim_feedforward=64)
    batch = described(net)
    optimizer = torch.optim.AdamW(net.parameters(), lr=3e-3)
    for step in range(350):
        loss, terms = net.loss(batch, 0.0, generator(step))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert float(terms["text"]) < 0.02  # the sines' own are .23
    assert float(terms["motion"]) < 0.02
    net.eval()
    with torch.no_grad():
        text, motion = net.encode_text(batch.states, batch.state_count), net.encode_motion(batch.motion, batch.frames)
        mixed = net.decode(text.mean, batch.frames)
    assert float(smooth_l1(mixed, batch.motion, torch.arange(12) < batch.frames[:, None])) < 0.02
    # Each text lies nearest to its own motion, though the weight of Eq. 3 is tiny: both must decode alike.
    assert torch.cdist(text.mean, motion.mean).argmin(1).tolist() == [0, 1, 2, 3]
    assert divergence(text, text).abs().max() < 1e-5


def test_saved_models_return_with_their_statistics(context, tmp_path):
    net = model(context).take_statistics(torch.full((67,), 2.0), torch.full((67,), 0.5)).eval()
    save_model(tmp_path, "temos", net, context)
    back = load_model(tmp_path)
    batch = described(net)
    assert torch.equal(
        net.encode_motion(batch.motion, batch.frames)[0], back.encode_motion(batch.motion, batch.frames)[0]
    )
    assert back.normalizer.std[0] == 0.5


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"num_heads": 6}, "temos.num_heads: 6: must divide latent"),
        ({"text_heads": 3}, "temos.text_heads: 3: must divide latent"),
        ({"latent": 15, "num_heads": 1}, "temos.latent: 15: must be even"),
        ({"features": "smpl"}, "temos.features: smpl: must be one of"),
        ({"architecture": "lstm"}, "temos.architecture: lstm: must be one of"),
        ({"kl_weight": -1.0}, "temos.kl_weight"),
    ],
)
def test_bad_settings_are_one_line(settings, message):
    with pytest.raises(InputError, match=message):
        TemosConfig(**{**SMALL, **settings})


def test_a_model_without_a_motion_encoder_says_so(context):
    net = model(context, motion_encoder=False)
    with pytest.raises(InputError, match="reads no motion"):
        net.encode_motion(torch.zeros(1, 4, 67), torch.tensor([4]))


# With the packaged language model -----------------------------------------------------------------------------------


def speaking(context, **settings) -> TemosGenerator:
    net = model(context, text_dim=384, **settings).take_statistics(torch.zeros(67), torch.full((67,), 0.05))
    return TemosGenerator(net, lambda texts, seeds, likeliest: [40 + 4 * int(s) for s in seeds], chunk=2)


def sentences() -> list[Sentence]:
    texts = {"a person walks": ("a", "person", "walk"), "a person jumps": ("a", "person", "jump"), "runs": ("run",)}
    return [Sentence(text, words, ("NOUN",) * len(words)) for text, words in texts.items()]


def test_generation_depends_on_its_own_text_seed_and_duration_alone(context):
    maker = speaking(context)
    texts = sentences()
    together = maker.generate(texts, [3, 4, 5], [48, 36, 80])
    assert [m.frames for m in together] == [48, 36, 80]
    assert all(m.fps == context.fps for m in together)
    alone = maker.generate(texts[1:2], [4], [36])[0]
    np.testing.assert_allclose(alone.positions, together[1].positions, atol=1e-4)
    other = maker.generate(texts[1:2], [9], [36])[0]
    assert np.abs(other.positions - alone.positions).max() > 1e-3
    mean = [maker.generate(texts[:1], [seed], [36], greedy=True)[0].positions for seed in (1, 2)]
    np.testing.assert_array_equal(*mean)
    assert [m.frames for m in maker.generate(texts, [0, 1, 2])] == [40, 44, 48]  # of the lengths' own draw


def test_a_blend_starts_at_one_text_and_ends_at_the_other(context):
    maker = speaking(context)
    walk, jump, _ = sentences()
    line = maker.blend(walk, jump, 5, 40, seed=7)
    ends = maker.generate([walk, jump], [7, 7], [40, 40])
    np.testing.assert_allclose(line[0].positions, ends[0].positions, atol=1e-4)
    np.testing.assert_allclose(line[-1].positions, ends[1].positions, atol=1e-4)
    latents = maker.latents([walk, jump]).mean
    middle = maker.decode(latents.mean(0, keepdim=True), [40])[0]
    mean = maker.blend(walk, jump, 3, 40, greedy=True)[1]
    np.testing.assert_allclose(mean.positions, middle.positions, atol=1e-4)
    with pytest.raises(InputError, match="steps"):
        maker.blend(walk, jump, 1, 40)


@pytest.mark.parametrize("frames", [0, -4, 200, 3])
def test_a_duration_that_was_never_learned_is_one_line(context, frames):
    with pytest.raises(InputError, match=r"frames: -?\d+: must be a whole number from 4 to 196"):
        speaking(context).generate(sentences()[:1], [0], [frames])


def test_a_text_of_ten_thousand_characters_is_one_line(context):
    long = Sentence("walk " * 2000, ("walk",), ("VERB",))
    with pytest.raises(InputError, match="must have at most 1000 characters, has 10000"):
        speaking(context).generate([long], [0], [40])


def test_fine_tuning_reaches_the_language_model(context):
    from motionary.language.frozen import token_ids, token_states

    net = model(context, fine_tune=True, text_dim=384)
    ids = token_ids(["a person walks", "somebody slowly turns left"])
    count = torch.tensor([len(row) for row in ids])
    text = torch.zeros(2, int(count.max()), dtype=torch.long)
    for row, tokens in enumerate(ids):
        text[row, : len(tokens)] = torch.from_numpy(tokens)
    frozen = model(context, text_dim=384)
    # Untrained, it reads what the frozen one's stored states say.
    net.eval(), frozen.eval()
    frozen.text.load_state_dict(net.text.state_dict())
    for row, states in enumerate(token_states(["a person walks", "somebody slowly turns left"])):
        expected = frozen.encode_text(torch.from_numpy(states)[None], count[row : row + 1]).mean
        assert torch.allclose(net.encode_text(text, count).mean[row], expected[0], atol=5e-3)
    batch = described(net, (12, 9), (7, 4))
    batch.states, batch.state_count = text, count
    net.loss(batch, 0.0, generator())[0].backward()
    grads = [p.grad for p in net.language.encoder.parameters()]
    assert all(g is not None and g.abs().sum() > 0 for g in grads[:4])
