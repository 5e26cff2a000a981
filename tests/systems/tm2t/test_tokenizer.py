"""Motion tokens (TM2T 3.1) and their codebook."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from motionary.errors import InputError
from motionary.features.humanml3d import recover_positions_torch
from motionary.nn.layers import seeded
from motionary.nn.quantizer import Quantizer, usage
from motionary.systems.tm2t.tokenizer import Tokenizer, TokenizerConfig

SMALL = TokenizerConfig(codebook_size=16, code_dim=8, width=24, fine_width=16, decoder_blocks=2, codebook_start=0.0)


def build(context, **changes):
    with seeded(0):
        return Tokenizer(dataclasses.replace(SMALL, **changes), context)


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def test_four_frames_make_a_token(context, batch):
    model = build(context)
    codes = model.encode(batch.motion, batch.frames)
    assert codes.shape == (4, 8)
    assert codes.dtype == torch.int64
    assert model.decode(codes).shape == batch.motion.shape
    assert model.token_contexts().shape == (16, 4, 263)
    torch.testing.assert_close(model.token_contexts()[3], model.decode(torch.tensor([[3]]))[0])


def test_paper_architecture_has_the_published_layers(context):
    """Table 3: widths 1024, 259 in, 263 out, convolutions of width 4, 3 and 3."""
    paper = TokenizerConfig(
        codebook_size=1024,
        code_dim=1024,
        width=1024,
        fine_width=0,
        encoder_blocks=1,
        fine_blocks=1,
        decoder_blocks=2,
        dilation=1,
    )
    with torch.device("meta"):
        model = Tokenizer(paper, context)
    found = [tuple(p.shape) for part in (model.encoder, model.decoder) for p in part.parameters() if p.dim() == 3]
    expected = [(1024, 259, 4), (1024, 1024, 4), (263, 1024, 3), (263, 263, 3), *[(1024, 1024, 3)] * 9]
    assert sorted(found) == sorted(expected)


def test_the_encoder_does_not_see_foot_contacts(context, batch):
    changed = batch.motion.clone()
    changed[..., -4:] += 1
    model = build(context)
    with torch.no_grad():
        before, after = model.latents(batch.motion, batch.frames), model.latents(changed, batch.frames)
    assert torch.equal(before, after)
    assert model.decode(torch.zeros(1, 2, dtype=torch.long)).shape[-1] == 263


def test_results_do_not_depend_on_padding(context, batch):
    model = build(context)
    model.quantizer.start(torch.randn(64, 8, generator=generator()), generator())
    dirty = batch.motion.clone()
    dirty[2, 16:] = 1e4
    codes = model.encode(dirty, batch.frames)
    alone = model.encode(batch.motion[2:3, :16])
    assert torch.equal(codes[2, :4], alone[0])
    assert (codes[2, 4:] == 0).all()
    decoded = model.decode(codes, batch.frames // 4)
    torch.testing.assert_close(decoded[2, :16], model.decode(alone)[0])
    model.eval()
    clean, _ = model.loss(batch, 1.0, generator())
    batch.motion = dirty
    torch.testing.assert_close(model.loss(batch, 1.0, generator())[0], clean)


def test_nearest_code_by_its_definition():
    quantizer = Quantizer(7, 3, "gradient")
    latents = torch.randn(2, 5, 3, generator=generator())
    expected = torch.cdist(latents.reshape(-1, 3), quantizer.codebook.detach()).argmin(1).reshape(2, 5)
    assert torch.equal(quantizer.nearest(latents), expected)
    assert torch.equal(quantizer.look_up(expected), quantizer.codebook[expected])


def test_each_term_of_equation_3_reaches_its_own_tensor():
    quantizer = Quantizer(4, 2, "gradient")
    latents = torch.randn(1, 6, 2, generator=generator(), requires_grad=True)
    mask = torch.tensor([[True] * 5 + [False]])
    quantized, codes, embedding, commitment = quantizer(latents, mask)
    difference = (latents - quantizer.codebook[codes])[0, :5].detach()
    torch.testing.assert_close(embedding, difference.square().mean())
    torch.testing.assert_close(commitment, difference.square().mean())

    (to_latents, to_codebook) = torch.autograd.grad(
        commitment, [latents, quantizer.codebook], retain_graph=True, allow_unused=True
    )
    torch.testing.assert_close(to_latents[0, :5], 2 * difference / 10)
    assert (to_latents[0, 5] == 0).all()
    assert to_codebook is None

    (to_latents, to_codebook) = torch.autograd.grad(
        embedding, [latents, quantizer.codebook], retain_graph=True, allow_unused=True
    )
    assert to_latents is None
    expected = torch.zeros(4, 2).index_add_(0, codes[0, :5], -2 * difference / 10)
    torch.testing.assert_close(to_codebook, expected)

    (straight,) = torch.autograd.grad((quantized * torch.arange(12.0).reshape(1, 6, 2)).sum(), latents)
    assert torch.equal(straight, torch.arange(12.0).reshape(1, 6, 2))
    torch.testing.assert_close(quantized, quantizer.look_up(codes))


def test_running_means_in_closed_form():
    quantizer = Quantizer(2, 1, "ema", decay=0.5).train()
    quantizer.codebook.copy_(torch.tensor([[0.0], [10.0]]))
    quantizer.counts.copy_(torch.tensor([2.0, 4.0]))
    quantizer.sums.copy_(torch.tensor([[0.0], [40.0]]))
    latents = torch.tensor([[[1.0], [3.0], [12.0], [99.0]]])
    _, codes, embedding, _ = quantizer(latents, torch.tensor([[True, True, True, False]]))
    assert codes.tolist() == [[0, 0, 1, 1]]
    assert float(embedding) == 0
    assert quantizer.counts.tolist() == [2.0, 2.5]
    assert quantizer.sums.flatten().tolist() == [2.0, 26.0]
    torch.testing.assert_close(quantizer.codebook, torch.tensor([[1.0], [26 / 2.5]]), rtol=1e-4, atol=1e-4)
    before = quantizer.codebook.clone()
    quantizer.eval()(latents, torch.ones(1, 4, dtype=torch.bool))
    assert torch.equal(quantizer.codebook, before)


def test_dead_codes_restart_on_recent_latents():
    quantizer = Quantizer(3, 2, "ema", decay=0.0, dead=0.5).train()
    quantizer.start(torch.tensor([[0.0, 0.0], [1.0, 1.0], [50.0, 50.0]]), generator())
    latents = torch.tensor([[[0.0, 0.1], [1.0, 1.1]]])
    quantizer(latents, torch.ones(1, 2, dtype=torch.bool))
    assert quantizer.restart(generator()) == 1
    assert quantizer.restart(generator()) == 0  # nothing recent any more
    moved = torch.cdist(quantizer.codebook, latents[0]).min(1).values
    assert float(moved.max()) < 1e-3
    codes = quantizer.nearest(latents)
    assert codes[0, 0] != codes[0, 1]


def test_the_codebook_starts_from_encoder_outputs(context, batch):
    model = build(context, codebook_start=0.5).train()
    before = model.quantizer.codebook.clone()
    model.loss(batch, 0.4, generator())
    assert torch.equal(model.quantizer.codebook, before)
    assert not bool(model.quantizer.started)
    model.loss(batch, 0.5, generator())
    assert bool(model.quantizer.started)
    with torch.no_grad():
        latents = model.latents(batch.motion, batch.frames)
        latents = torch.cat([v[: n // 4] for v, n in zip(latents, batch.frames.tolist(), strict=True)])
    assert float(torch.cdist(latents, model.quantizer.codebook).min(1).values.mean()) < 0.5 * float(latents.std())
    fewer = Quantizer(64, 8, "gradient")
    fewer.start(latents[:5], generator())
    assert bool(torch.isfinite(fewer.codebook).all())


def test_gradient_reaches_the_encoder_through_the_codes(context, batch):
    model = build(context, commitment_weight=0.0, quantizer="ema").train()
    model.loss(batch, 0.9, generator())[0].backward()
    assert float(model.encoder.first.convolution.weight.grad.abs().sum()) > 0
    assert float(model.decoder.output.weight.grad.abs().sum()) > 0


def test_late_in_training_the_decoder_alone_learns(context, batch):
    model = build(context, freeze_encoder_from=0.8).train()
    model.loss(batch, 0.1, generator())
    codebook = model.quantizer.codebook.clone()
    model.zero_grad()
    model.loss(batch, 0.9, generator())[0].backward()
    assert model.encoder.first.convolution.weight.grad is None
    assert float(model.decoder.output.weight.grad.abs().sum()) > 0
    assert torch.equal(model.quantizer.codebook, codebook)


def test_usage_and_perplexity():
    share, perplexity = usage(torch.tensor([0, 1, 0, 1]), 4)
    assert float(share) == 0.5
    assert float(perplexity) == pytest.approx(2)


def test_root_path_is_the_codec_s(context, batches):
    rng = np.random.default_rng(0)
    raw = torch.from_numpy(rng.normal(0, 0.3, (2, 20, 263)).astype(np.float32))
    expected = recover_positions_torch(raw, 22)[:, :, 0, [0, 2]]
    torch.testing.assert_close(context.make_codec().root_path(raw), expected, rtol=1e-4, atol=1e-4)


def test_trajectory_weight_adds_its_term(context, batch):
    model = build(context, trajectory_weight=2.0).eval()
    plain = build(context).eval()
    with_term, terms = model.loss(batch, 1.0, generator())
    torch.testing.assert_close(with_term - plain.loss(batch, 1.0, generator())[0], 2 * terms["trajectory"])


@pytest.mark.parametrize("quantizer", ["ema", "gradient"])
def test_one_batch_is_learned(context, batches, quantizer):
    model = build(context, quantizer=quantizer, codebook_size=32, width=48, codebook_start=0.2).train()
    batch = batches(context, [32, 32, 24])
    optimizer = torch.optim.Adam(model.parameters(), 3e-3)
    start = float(model.loss(batch, 0.0, generator())[0].detach())
    for step in range(120):
        loss, _ = model.loss(batch, step / 120, generator(step))
        loss.backward()
        optimizer.step()
        optimizer.zero_grad()
        model.after_step(step, step / 120, generator(step))
    values = model.eval().validate(batch)
    assert float(values["reconstruction"]) < 0.5 * start
    assert float(values["usage"]) > 0.3


@pytest.mark.parametrize(
    ("key", "value"), [("quantizer", "soft"), ("codebook_size", 1), ("codebook_decay", 1.0), ("dilation", 0)]
)
def test_wrong_values_are_named(key, value):
    with pytest.raises(InputError, match=rf"tokenizer\.{key}"):
        TokenizerConfig(**{key: value})
