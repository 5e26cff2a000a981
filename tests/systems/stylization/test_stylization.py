"""Stylization: closed forms, frozen codes, what the label changes; company, length and seeds do as promised."""

from __future__ import annotations

import dataclasses
import tempfile
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch

from motionary.errors import InputError
from motionary.nn.layers import seeded
from motionary.systems.io import Trained, build_model, load_model, open_system, save_model
from motionary.systems.stylization.global_motion import GlobalMotion, GlobalMotionConfig
from motionary.systems.stylization.latents import Latents, LatentsConfig
from motionary.systems.stylization.style_networks import EPSILON, adaptive_norm, instance_norm
from motionary.systems.stylization.style_transfer import StyleTransfer
from motionary.systems.stylization.stylizer import (
    StylizationConfig,
    Stylizer,
    divergence,
    trainable,
)

SMALL = {"width": 24, "content_dim": 8, "style_dim": 6, "num_blocks": 1}
WEIGHTS = {"supervised": {"hsa": 1.0, "cycle": 0.1, "kl": 0.1}, "unsupervised": {"hsa": 0.1, "cycle": 1.0, "kl": 0.01}}


@pytest.fixture(scope="module")
def styled(context):
    """The context with three styles."""
    return dataclasses.replace(context, styles=("happy", "neutral", "old"))


def latents_of(context, variant="V"):
    with seeded(0):
        return Latents(LatentsConfig(variant, width=16, code_dim=12), context).eval()


def built(values, setting, latents, context):
    """As the stage builds it, on saved latents."""
    with tempfile.TemporaryDirectory() as folder:
        save_model(Path(folder) / "latents", "latents", latents, context)
        return build_model("stylization", {**values, "setting": setting, "window": 32}, context, Trained(folder))


def stylizer(context, setting, variant="V"):
    with seeded(1):
        return built({**SMALL, **WEIGHTS}, setting, latents_of(context, variant), context)


def triples(make, context, frames=(40, 24, 32)):
    """Three triples of smooth made-up motion with styles."""
    batch = make(context, list(frames) * 3)
    batch.style = torch.tensor([0, 1, 2, 0, 1, 2, 2, 0, 1])
    return batch


def generator(seed=0):
    return torch.Generator().manual_seed(seed)


@pytest.fixture(scope="module")
def transfer(styled):
    with seeded(2):
        root = GlobalMotion(GlobalMotionConfig(width=8), styled)
    return StyleTransfer({name: stylizer(styled, name) for name in ("supervised", "unsupervised")}, root)


def motions(context, *frames, seed=0):
    rng = np.random.default_rng(seed)
    made = [rng.normal(size=(1, context.dim)) + 0.1 * rng.normal(size=(n, context.dim)).cumsum(0) for n in frames]
    return [(context.mean + context.std * m).astype(np.float32) for m in made]


@pytest.mark.parametrize("setting", ["supervised", "unsupervised"])
def test_gradients_of_the_shortest_stretches_stay_small(styled, setting, batches):
    """Over two steps of content many channels hardly move: what normalizes them must not multiply gradients."""
    largest = []
    for seed in range(12):
        net, batch = stylizer(styled, setting), triples(partial(batches, seed=seed), styled, (16, 16, 12))
        net.train().loss(batch, 0.0, generator(seed))[0].backward()
        parts = [p.grad.norm() for p in net.parameters() if p.grad is not None]
        largest.append(float(torch.stack(parts).norm()))
    assert max(largest) < 300, "1e-5 beside the variance gives 1,554 and 342,638 here"


def test_instance_norm_is_the_closed_form():
    """Mean 0, variance 1 over the valid steps alone; AdaIN gives them the mean and deviation that it is told."""
    x = torch.randn(2, 5, 9, generator=generator()) * 3 + 2
    torch.testing.assert_close(instance_norm(x), torch.nn.functional.instance_norm(x, eps=EPSILON))
    mask = (torch.arange(9) < torch.tensor([9, 6])[:, None])[:, None].float()
    masked = instance_norm(x * mask, mask)
    torch.testing.assert_close(masked[0], instance_norm(x[:1])[0])
    torch.testing.assert_close(masked[1, :, :6], instance_norm(x[1:, :, :6])[0])
    assert not masked[1, :, 6:].any()
    gain, bias = torch.tensor([[2.0] * 5, [0.5] * 5]), torch.tensor([[1.0] * 5, [-3.0] * 5])
    made = adaptive_norm(x * mask, gain, bias, mask)[1, :, :6]
    torch.testing.assert_close(made.mean(-1), bias[1], atol=1e-5, rtol=0)
    variance = x[1, :, :6].var(-1, correction=0)
    wanted = gain[1] * (variance / (variance + EPSILON)).sqrt()
    torch.testing.assert_close(made.std(-1, correction=0), wanted, atol=1e-5, rtol=0)


def test_divergence_is_the_closed_form():
    """KL of diagonal normals against torch's own, a mean over dimensions."""
    a, b, c, d = torch.randn(4, 3, 5, generator=generator())
    normal = torch.distributions.Normal
    left, right = normal(a, (0.5 * b).exp()), normal(c, (0.5 * d).exp())
    torch.testing.assert_close(divergence(a, b, c, d), torch.distributions.kl_divergence(left, right).mean(-1))
    torch.testing.assert_close(divergence(a, b), torch.distributions.kl_divergence(left, normal(0.0, 1.0)).mean(-1))
    assert divergence(a, b, a, b).abs().max() < 1e-6


@pytest.mark.parametrize("variant", ["V", "A", "none"])
def test_codes_do_not_depend_on_padding(styled, batch, variant):
    """Four frames to a code; longer company changes nothing; without latents, decoding returns the frames."""
    model = latents_of(styled, variant)
    local = model.local(batch.motion)
    with torch.no_grad():
        codes = model.encode(local, batch.frames)
        alone = model.encode(local[2:3, :16])
        decoded = model.decode(codes, batch.frames // 4)
        back = model.decode(alone)
    assert codes.shape == (4, model.dim, 8)
    torch.testing.assert_close(codes[2:3, :, :4], alone, atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(decoded[2:3, :16], back, atol=1e-5, rtol=1e-5)
    assert not codes[2, :, 4:].any()
    assert not decoded[2, 16:].any()
    if variant == "none":
        torch.testing.assert_close(back, local[2:3, :16])
        assert not list(model.parameters())


@pytest.mark.parametrize("variant", ["V", "A"])
def test_latents_overfit_one_batch(styled, batch, variant):
    """Reconstruction falls to less than half, and the penalties of the variant are in the loss."""
    with seeded(0):
        model = Latents(LatentsConfig(variant, width=64, code_dim=64), styled).train()
    optimizer = torch.optim.Adam(model.parameters(), 3e-3)
    values = []
    for step in range(60):
        loss, terms = model.loss(batch, 0.0, generator(step))
        loss.backward()
        optimizer.step()
        optimizer.zero_grad()
        values.append(float(terms["reconstruction"]))
    assert values[-1] < 0.5 * values[0]
    penalty = {"V": {"kl"}, "A": {"sparsity", "smoothness"}}[variant]
    assert set(terms) == {"reconstruction"} | penalty
    assert set(model.eval().validate(batch)) == {"loss", "position_mm", *({"reconstruction"} | penalty) - {"kl"}}


def test_root_velocities_are_learned_from_local_motion(styled, batch):
    """Where the root's velocities are a function of local motion, they are found; padding changes nothing."""
    with seeded(0):
        model = GlobalMotion(GlobalMotionConfig(width=32), styled).train()
    raw = batch.motion.clone()
    raw[..., :3] = (0.1 * raw[..., 60:63] + 0.05 * raw[..., 80:83]) * (raw != 0).any(-1, keepdim=True)
    batch.motion = raw
    optimizer = torch.optim.Adam(model.parameters(), 1e-2)
    first = float(model.validate(batch)["loss"])
    for _ in range(60):
        loss, _ = model.loss(batch, 0.0, generator())
        loss.backward()
        optimizer.step()
        optimizer.zero_grad()
    assert float(model.validate(batch)["loss"]) < 0.4 * first
    local = model.normalizer(raw)[..., 3:]
    with torch.no_grad():
        torch.testing.assert_close(model(local, batch.frames)[2:3, :16], model(local[2:3, :16]), atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("setting", ["supervised", "unsupervised"])
def test_every_weight_but_the_autoencoders_learns(styled, batches, setting):
    """Gradients reach all of the three networks and none of the frozen autoencoder, whose codes stay the same."""
    model = stylizer(styled, setting).train()
    before = {name: value.clone() for name, value in model.latents.state_dict().items()}
    loss, terms = model.loss(triples(batches, styled), 0.0, generator())
    loss.backward()
    c = model.config
    torch.testing.assert_close(
        loss.detach(), terms["reconstruction"] + c.hsa * terms["hsa"] + c.cycle * terms["cycle"] + c.kl * terms["kl"]
    )
    for name, parameter in model.named_parameters():
        if name.startswith("latents."):
            assert parameter.grad is None, name
        else:
            assert parameter.grad is not None, name
            assert parameter.grad.abs().sum() > 0, name
    assert not model.latents.training
    for name, value in model.latents.state_dict().items():
        torch.testing.assert_close(value, before[name])


def test_dropping_the_label_is_the_only_difference(styled):
    """The unsupervised stylizer has all weights of the supervised one but the label embeddings."""
    supervised, unsupervised = (stylizer(styled, setting).state_dict() for setting in WEIGHTS)
    assert {k: v.shape for k, v in supervised.items() if "label" not in k} == {
        k: v.shape for k, v in unsupervised.items()
    }
    assert {k for k in supervised if "label" in k} == {"style_encoder.label.weight", "generator.label.weight"}
    told, free = (
        Stylizer(StylizationConfig(3, **SMALL, variant="none"), styled),
        stylizer(styled, "unsupervised", "none"),
    )
    told.load_state_dict(free.state_dict(), strict=False)
    told.style_encoder.label.weight.data.zero_()  # type: ignore[union-attr]
    told.generator.label.weight.data.zero_()  # type: ignore[union-attr]
    codes, label = torch.randn(2, free.latents.dim, 8, generator=generator()), torch.tensor([0, 2])
    for a, b in zip(told.style_encoder(codes, label), free.style_encoder(codes, None), strict=True):
        torch.testing.assert_close(a, b)
    torch.testing.assert_close(
        told.generator.style(codes[..., 0, :6], label), free.generator.style(codes[..., 0, :6], None)
    )


def test_overfits_one_batch(styled, batches):
    """Without codes in between, whose untrained decoder would set a floor, both reconstructions fall by a third."""
    batch = triples(batches, styled)
    with seeded(0):
        values = {**SMALL, **WEIGHTS, "width": 64, "content_dim": 32}
        model = built(values, "supervised", latents_of(styled, "none"), styled).train()
    optimizer = torch.optim.Adam([p for p in model.parameters() if p.requires_grad], 3e-3)
    rows = []
    for step in range(80):
        loss, terms = model.loss(batch, 0.0, generator(step))
        loss.backward()
        optimizer.step()
        optimizer.zero_grad()
        rows.append(terms)
    assert rows[-1]["reconstruction"] < 0.66 * rows[0]["reconstruction"]
    assert rows[-1]["cycle"] < 0.66 * rows[0]["cycle"]


def test_a_loss_does_not_depend_on_padding(styled, batches):
    """Zeros after the longest item change nothing."""
    model, batch = stylizer(styled, "unsupervised"), triples(batches, styled)
    loss, _ = model.loss(batch, 0.0, generator())
    batch.motion = torch.nn.functional.pad(batch.motion, (0, 0, 0, 16))
    torch.testing.assert_close(model.loss(batch, 0.0, generator())[0], loss)


@pytest.mark.parametrize("setting", ["supervised", "unsupervised"])
def test_any_length_and_any_company(transfer, styled, setting):
    """Results are as long as their contents and the same alone, to the last frame; seeds repeat and differ."""
    contents = motions(styled, 5, 64, 41, 203)
    labels = {"supervised": [0, 1, 2, 1], "unsupervised": None}[setting]
    together = transfer.stylize(contents, setting=setting, labels=labels, seeds=[3, 4, 5, 6])
    assert [made.shape for made in together] == [content.shape for content in contents]
    for i in (0, 2):
        told = None if labels is None else labels[i : i + 1]
        (alone,) = transfer.stylize(contents[i : i + 1], setting=setting, labels=told, seeds=[3 + i])
        np.testing.assert_allclose(alone, together[i], atol=1e-4)
        (other,) = transfer.stylize(contents[i : i + 1], setting=setting, labels=told, seeds=[8])
        assert np.abs(other - alone).max() > 1e-3


def test_label_reference_and_strength_do_what_they_say(transfer, styled):
    """Another label or reference changes the result; strength 0 gives the content as the autoencoder knows it."""
    content, first, second = motions(styled, 48, 64, 40)
    one = {"setting": "supervised", "seeds": [0]}
    happy, old = (transfer.stylize([content], labels=[k], **one)[0] for k in (0, 2))
    assert np.abs(happy - old).max() > 1e-3
    shown = [transfer.stylize([content], setting="unsupervised", seeds=[s], references=[r])[0]
             for s, r in ((0, first), (1, first), (0, second))]  # fmt: skip
    np.testing.assert_array_equal(shown[0], shown[1])
    assert not np.array_equal(shown[0], shown[2])
    model = transfer.model("supervised")
    with torch.no_grad():
        known = model.latents.decode(model.latents.encode(model.latents.local(torch.from_numpy(content[None]))))
    (kept,) = transfer.stylize([content], labels=[2], strength=0.0, **one)
    np.testing.assert_allclose(model.latents.local(torch.from_numpy(kept[None])), known, atol=1e-4)
    half = transfer.stylize([content], labels=[2], strength=0.5, **one)[0]
    assert np.abs(half - kept).mean() < np.abs(old - kept).mean()


def test_the_root_is_predicted_or_copied(transfer, styled):
    """Copied root velocities are the content's to the bit of rounding; predicted ones are others, all else equal."""
    content = motions(styled, 48)
    asked = {"setting": "unsupervised", "seeds": [0]}
    (predicted,), (copied,) = (transfer.stylize(content, predict_root=flag, **asked) for flag in (True, False))
    np.testing.assert_allclose(copied[:, :3], content[0][:, :3], atol=1e-5)
    assert np.abs(predicted[:, :3] - copied[:, :3]).max() > 1e-3
    np.testing.assert_array_equal(predicted[:, 3:], copied[:, 3:])


def test_saved_and_opened_it_gives_the_same(transfer, styled, tmp_path):
    """Weights, labels and the frozen autoencoder survive; one setting alone serves."""
    for setting, model in transfer.stylizers.items():
        save_model(tmp_path / "stylization" / setting, "stylization", model, styled)
    save_model(tmp_path / "global_motion", "global_motion", transfer.global_motion, styled)
    opened = open_system("stylization", "stylize", tmp_path)
    assert (opened.styles, opened.fps, opened.window, opened.receptive) == (("happy", "neutral", "old"), 20.0, 32, 30)
    content = motions(styled, 32)
    asked = {"setting": "supervised", "labels": [1], "seeds": [7]}
    np.testing.assert_array_equal(opened.stylize(content, **asked)[0], transfer.stylize(content, **asked)[0])
    assert isinstance(load_model(tmp_path / "stylization/supervised"), Stylizer)
    alone = StyleTransfer({"unsupervised": transfer.model("unsupervised")}, transfer.global_motion)
    with pytest.raises(InputError, match="no style labels"):
        alone.stylize(content, **asked)


def test_a_style_needs_its_receptive_field(transfer, styled):
    """A step of the style encoder sees 30 frames; moving any of them moves the code of a reference of that length."""
    (shortest, short) = motions(styled, 32, 29)
    codes = transfer.style_codes([shortest], setting="unsupervised")
    assert codes.shape == (1, SMALL["style_dim"])
    with pytest.raises(InputError, match=r"29 frames.*at least 30 frames, 1\.50 s"):
        transfer.style_codes([short], setting="unsupervised")


@pytest.mark.parametrize(
    ("given", "rule"),
    [
        ({"setting": "supervised"}, "needs one style label"),
        ({"setting": "supervised", "labels": [5]}, "happy, neutral, old"),
        ({"setting": "unsupervised", "labels": [0]}, "knows no labels"),
        ({"setting": "half"}, "supervised, unsupervised"),
        ({"setting": "unsupervised", "strength": -1.0}, "strength"),
        ({"setting": "unsupervised", "strength": float("nan")}, "strength"),
    ],
)
def test_bad_requests(transfer, styled, given, rule):
    with pytest.raises(InputError, match=rule):
        transfer.stylize(motions(styled, 32), seeds=[0], **given)


def test_bad_settings_and_missing_labels(styled, context, capsys):
    """Without labels the supervised setting is left out, with a line that says why, or is an error when alone."""
    assert trainable(["supervised", "unsupervised"], styled) == ["supervised", "unsupervised"]
    assert trainable(["supervised", "unsupervised"], context) == ["unsupervised"]
    assert "no style labels" in capsys.readouterr().err
    with pytest.raises(InputError, match="labels for"):
        trainable(["supervised"], context)
    with pytest.raises(InputError, match="half"):
        trainable(["half"], styled)
    with pytest.raises(InputError, match=r"latents\.variant"):
        LatentsConfig("B")
    with pytest.raises(InputError, match=r"stylization\.kl"):
        StylizationConfig(kl=-1)
    with pytest.raises(InputError, match="kernel"):
        GlobalMotionConfig(kernel=2)
