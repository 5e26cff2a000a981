"""Snippet codes (thesis 4.2.1)."""

from __future__ import annotations

import dataclasses

import pytest
import torch

from motionary.errors import InputError
from motionary.nn.layers import seeded
from motionary.systems.t2m.autoencoder import Autoencoder, AutoencoderConfig, distance, feature_weights, position_error

SMALL = AutoencoderConfig(width=32, code_dim=16)


def build(context, **changes):
    with seeded(0):
        return Autoencoder(dataclasses.replace(SMALL, **changes), context)


def test_four_frames_make_a_code(context, batch):
    model = build(context)
    codes = model.encode(batch.motion, batch.frames)
    assert codes.shape == (4, 8, 16)
    assert model.decode(codes, batch.frames // 4).shape == batch.motion.shape
    assert model.encode(batch.motion[:, :31]).shape == (4, 7, 16)  # an incomplete unit is cut


def test_the_encoder_does_not_see_foot_contacts(context, batch):
    changed = batch.motion.clone()
    changed[..., -4:] += 1
    model = build(context)
    assert torch.equal(model.encode(changed, batch.frames), model.encode(batch.motion, batch.frames))
    seeing = build(context, hide_contacts=False)
    assert not torch.equal(seeing.encode(changed, batch.frames), seeing.encode(batch.motion, batch.frames))


def test_results_do_not_depend_on_padding(context, batch):
    model = build(context)
    dirty = batch.motion.clone()
    dirty[2, 16:] = 1e4
    codes = model.encode(dirty, batch.frames)
    alone = model.encode(batch.motion[2:3, :16])
    torch.testing.assert_close(codes[2, :4], alone[0])
    assert (codes[2, 4:] == 0).all()
    decoded = model.decode(codes, batch.frames // 4)
    torch.testing.assert_close(decoded[2, :16], model.decode(alone)[0])


def test_a_code_sees_ten_frames(context, batches):
    """Two convolutions of width 4 and stride 2: code n sees frames 4n - 3 to 4n + 6."""
    model = build(context)
    raw = batches(context, [40]).motion.requires_grad_()
    model.encode(raw)[0, 4].square().sum().backward()
    seen = torch.nonzero(raw.grad[0].abs().sum(1)).flatten().tolist()
    assert seen == list(range(13, 23))


def test_large_errors_count_by_their_square_from_where_it_is_said():
    error = torch.tensor([-3.0, -0.5, 0.25, 0.5, 1.0])
    torch.testing.assert_close(distance(error, 0.0), error.abs())
    torch.testing.assert_close(distance(error, 0.5), torch.tensor([9.25, 0.5, 0.25, 0.5, 1.25]))
    knee = torch.tensor([0.4999, 0.5001], requires_grad=True)
    (slopes,) = torch.autograd.grad(distance(knee, 0.5).sum(), knee)
    torch.testing.assert_close(slopes, torch.ones(2), atol=1e-3, rtol=0)  # smooth where one becomes the other
    with pytest.raises(InputError, match="berhu_threshold"):
        AutoencoderConfig(berhu_threshold=-1.0)


def test_the_loss_is_equation_4_2(context, batch):
    full, plain = build(context), build(context, sparsity_weight=0.0, smoothness_weight=0.0)
    generator = torch.Generator()
    total, terms = full.loss(batch, 0.0, generator)
    bare, _ = plain.loss(batch, 0.0, generator)
    codes = full.encode(batch.motion, batch.frames)
    valid = [codes[i, : n // 4] for i, n in enumerate(batch.frames.tolist())]
    sparsity = torch.cat(valid).abs().mean()
    smoothness = torch.cat([v.diff(dim=0) for v in valid]).abs().mean()
    torch.testing.assert_close(terms["sparsity"], sparsity.detach())
    torch.testing.assert_close(terms["smoothness"], smoothness.detach())
    torch.testing.assert_close(total - bare, 0.001 * (sparsity + smoothness), atol=1e-6, rtol=1e-3)
    mean, std = torch.from_numpy(context.mean), torch.from_numpy(context.std)
    output = full.decode(codes, batch.frames // 4)
    errors = [((output - batch.motion)[i, :n] / std).abs() for i, n in enumerate(batch.frames.tolist())]
    torch.testing.assert_close(bare, torch.cat(errors).mean())
    assert mean.shape == (263,)


def test_position_error_is_in_millimeters_and_masks(batch):
    moved = batch.motion.clone()
    moved[..., 4:67:3] += 0.01  # every joint but the root 10 mm sideways
    moved[0, 30:] += 5
    frames = batch.frames.clone()
    frames[0] = 28
    assert float(position_error(moved, batch.motion, frames, slice(4, 67))) == pytest.approx(10 * 21 / 22, rel=1e-4)


def test_feature_weights_favor_positions():
    weights = feature_weights(263, slice(4, 67), 2.0)
    assert float(weights.mean()) == pytest.approx(1)
    assert float(weights[4] / weights[3]) == pytest.approx(3)
    assert float(weights[66] / weights[67]) == pytest.approx(3)
    assert torch.equal(feature_weights(263, slice(4, 67), 0.0), torch.ones(263))


def test_one_batch_is_learned(context, batches):
    model, batch = build(context, width=64, code_dim=64), batches(context, [32, 32, 24])
    optimizer = torch.optim.Adam(model.parameters(), 3e-3)
    start = float(model.validate(batch)["loss"])
    for _ in range(80):
        loss, _ = model.loss(batch, 0.0, torch.Generator())
        loss.backward()
        optimizer.step()
        optimizer.zero_grad()
    values = model.validate(batch)
    assert float(values["loss"]) < 0.3 * start
    assert set(values) >= {"loss", "position_mm", "reconstruction"}
