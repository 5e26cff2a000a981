"""Residual tokens: every layer takes from the error, padding changes nothing, sliding feet have a closed form."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from motionary.corpus.demo import demo_clip
from motionary.corpus.token_store import TokenStore
from motionary.errors import InputError
from motionary.nn.layers import seeded
from motionary.nn.residual_quantizer import ResidualQuantizer
from motionary.systems.masked.residual_tokenizer import ResidualTokenizer, ResidualTokenizerConfig

SMALL = ResidualTokenizerConfig(
    codebook_size=16, num_quantizers=3, code_dim=8, width=24, fine_width=16, decoder_blocks=2, codebook_start=0.0
)


def build(context, **changes) -> ResidualTokenizer:
    with seeded(0):
        return ResidualTokenizer(dataclasses.replace(SMALL, **changes), context)


def draws(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def started(layers: int, shared: bool = False) -> tuple[ResidualQuantizer, torch.Tensor]:
    with seeded(0):
        quantizer, latents = ResidualQuantizer(8, 4, layers, 0.9, 0.1, shared), torch.randn(200, 4)
    quantizer.start(latents, draws())
    return quantizer, latents


@pytest.mark.parametrize("shared", [False, True])
def test_each_layer_codes_what_is_left(shared):
    quantizer, latents = started(3, shared)
    codes = quantizer.encode(latents)
    assert codes.shape == (200, 3)
    errors = [(latents - quantizer.look_up(codes[:, :n])).square().mean() for n in (1, 2, 3)]
    assert errors[0] > errors[1] > errors[2]
    left = latents - quantizer.look_up(codes[:, :2])
    distances = torch.cdist(left, quantizer.codebooks()[2])
    assert torch.equal(distances.argmin(1), codes[:, 2])
    assert (quantizer.layers[1] is quantizer.layers[2]) == shared


def test_an_item_with_fewer_layers_moves_only_those():
    quantizer, latents = started(3)
    quantizer.train()
    before = quantizer.codebooks().clone()
    batch, mask = latents[None, :50], torch.ones(1, 50, dtype=torch.bool)
    entries, codes, commitment = quantizer(batch, mask, torch.tensor([2]))
    torch.testing.assert_close(entries, _summed(before, codes[..., :2]))
    moved = (quantizer.codebooks() - before).abs().amax((1, 2))
    assert moved[0] > 1e-3
    assert moved[1] > 1e-3
    assert moved[2] < 1e-3  # nothing was given to it but a smoothing of its counts
    assert commitment > 0


def _summed(books: torch.Tensor, codes: torch.Tensor) -> torch.Tensor:
    return sum((books[i][codes[..., i]] for i in range(codes.shape[-1])), torch.zeros(()))


def test_gradients_pass_straight_through():
    quantizer, latents = started(2)
    x = latents[None, :5].clone().requires_grad_()
    quantizer(x, torch.ones(1, 5, dtype=torch.bool), torch.tensor([2]))[0].sum().backward()
    assert x.grad is not None
    assert torch.equal(x.grad, torch.ones_like(x))


def test_tokens_have_layers_and_decoding_takes_any_number(context, batch):
    model = build(context).eval()
    codes = model.encode(batch.motion, batch.frames)
    assert codes.shape == (4, 8, 3)
    assert (codes[2, 4:] == 0).all()
    count = batch.frames // 4
    base = model.decode(codes[..., 0], count)
    torch.testing.assert_close(base, model.decode(codes[..., :1], count))
    assert base.shape == batch.motion.shape
    assert model.token_contexts().shape == (16, 4, 263)


def test_padding_and_neighbors_change_nothing(context, batch):
    model = build(context).eval()
    model.quantizer.start(torch.randn(64, 8, generator=draws()), draws())
    dirty = batch.motion.clone()
    dirty[2, 16:] = 1e4
    codes = model.encode(dirty, batch.frames)
    alone = model.encode(batch.motion[2:3, :16])
    assert torch.equal(codes[2, :4], alone[0])
    torch.testing.assert_close(model.decode(codes, batch.frames // 4)[2, :16], model.decode(alone)[0])
    loss = model.loss(batch, 1.0, draws())[0]
    batch.motion = dirty
    torch.testing.assert_close(model.loss(batch, 1.0, draws())[0], loss)


# Learned codebooks: the share of the base's error that is left is .54 to .67 by the seed. A grid's base gets a batch
# right by itself, since the encoder learns to meet its points.
@pytest.mark.parametrize(("levels", "most"), [((), 0.8), ((4, 4), 1.0)], ids=["codebooks", "fsq"])
def test_a_batch_is_learned_and_more_layers_tell_more(context, batch, levels, most):
    model, rng = build(context, quantizer_dropout=0.3, levels=levels).train(), draws()
    optimizer = torch.optim.AdamW(model.parameters(), lr=5e-3)
    for step in range(300):
        model.loss(batch, step / 300, rng)[0].backward()
        optimizer.step()
        optimizer.zero_grad()
        model.after_step(step, step / 300, rng)
    values = model.eval().validate(batch)
    assert values["position_mm"] < 20
    assert values["reconstruction"] < 0.05
    assert values["position_mm"] < most * values["base_position_mm"]


def test_feet_that_slide_cost_their_speed(context):
    """Real features of feet that stand cost next to nothing; moved by 0.1 m a frame they cost 2 m/s more."""
    model = build(context)
    motion = demo_clip(0)[0]
    raw = torch.from_numpy(context.make_codec().encode(motion))[None]
    still = torch.zeros_like(raw[:, :1]).expand(1, 20, -1).clone()
    still[..., context.columns("contacts")] = 1.0
    everywhere = torch.ones(1, 20, dtype=torch.bool)
    assert model._sliding(still, everywhere) < 1e-2
    moved = still.clone()
    moved[..., context.columns("root_linear")] = torch.tensor([0.0, 0.1])
    torch.testing.assert_close(model._sliding(moved, everywhere), torch.tensor(2.0), rtol=1e-3, atol=1e-3)
    moved[..., context.columns("contacts")] = 0.0
    assert model._sliding(moved, everywhere) == 0
    assert 0 < model._sliding(raw, torch.ones(raw.shape[:2], dtype=torch.bool)) < 0.3


def test_contact_columns_are_those_of_their_joints(context):
    motion, codec = demo_clip(0)[0], context.make_codec()
    features = codec.encode(motion)
    feet = torch.from_numpy(motion.positions[:, list(codec.contact_joints)])
    still = feet.diff(dim=0).square().sum(-1) < codec.contact_threshold
    told = features[:, codec.slices["contacts"]] > 0.5
    assert (still.numpy() == told).mean() > 0.98
    decoded = codec.joints(torch.from_numpy(features)).numpy()
    np.testing.assert_allclose(decoded, codec.decode(features).positions, atol=1e-4)


def test_tokens_in_layers_pass_through_the_store(tmp_path):
    rng = np.random.default_rng(0)
    sequences = [rng.integers(0, 512, (n, 4)) for n in (3, 1, 7)]
    TokenStore.collect(sequences).save(tmp_path)
    store = TokenStore.load(tmp_path)
    assert len(store) == 3
    for i, codes in enumerate(sequences):
        np.testing.assert_array_equal(store[i], codes)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"num_quantizers": 0}, "residual_tokenizer.num_quantizers: 0"),
        ({"quantizer_dropout": 1.5}, "residual_tokenizer.quantizer_dropout"),
        ({"levels": (8, 8)}, "residual_tokenizer.levels"),
        ({"contact_weight": -1.0}, "residual_tokenizer.contact_weight"),
    ],
)
def test_bad_settings_are_one_line(settings, message):
    with pytest.raises(InputError, match=message):
        dataclasses.replace(SMALL, **settings)


def test_sliding_needs_features_with_contacts(context):
    from motionary.features import codec

    dim = codec("rifke", context.skeleton).dim
    other = dataclasses.replace(context, codec="rifke", mean=context.mean[:dim], std=context.std[:dim])
    with pytest.raises(InputError, match="must be 0: features of the codec rifke tell no foot contacts"):
        build(other)
