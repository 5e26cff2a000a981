"""FSQ in layers: closed-form points, each layer finer than the one before, gradients past the rounding."""

from __future__ import annotations

import pytest
import torch

from motionary.errors import InputError
from motionary.nn.finite_scalar import FiniteScalarQuantizer, check_levels
from motionary.nn.layers import seeded


def build(levels=(8, 5), dim: int = 6, layers: int = 3) -> FiniteScalarQuantizer:
    with seeded(0):
        return FiniteScalarQuantizer(levels, dim, layers)


def plain(levels, layers: int) -> FiniteScalarQuantizer:
    """One whose z is tanh of the latents, and whose entries are the points themselves."""
    quantizer = build(levels, len(levels), layers)
    with torch.no_grad():
        quantizer.inward.weight.copy_(torch.eye(len(levels)))
        quantizer.inward.bias.zero_()
        quantizer.outward.weight.copy_(torch.eye(len(levels)))
    return quantizer


def test_points_and_codes_have_a_closed_form():
    quantizer = plain((4, 3), 2)
    z = torch.tensor([[0.4, -0.9]])  # steps of 2/3 and 1 from -1: nearest 1/3 and -1; left .0667 and .1
    latents = torch.atanh(z)
    codes = quantizer.encode(latents)
    # First layer: indices 2 and 0, code 2 + 4 * 0. Second: left / (1/3, 1/2) is (.2, .2), nearest 1/3 and 0: 2 and 1.
    assert codes.tolist() == [[2, 2 + 4 * 1]]
    torch.testing.assert_close(quantizer.look_up(codes[:, :1]), torch.tensor([[1 / 3, -1.0]]))
    torch.testing.assert_close(quantizer.look_up(codes), torch.tensor([[1 / 3 + 1 / 9, -1.0]]))


@pytest.mark.parametrize("levels", [(8, 8, 8), (2, 2), (7, 5, 5)])
def test_each_layer_is_finer_by_its_steps(levels):
    quantizer = plain(levels, 4)
    latents = torch.randn(500, len(levels), generator=torch.Generator().manual_seed(0))
    codes = quantizer.encode(latents)
    z = torch.tanh(latents)
    for layers in (1, 2, 3, 4):
        left = (z - quantizer.look_up(codes[:, :layers])).abs().amax(0)
        step = torch.tensor([(level - 1.0) ** -layers for level in levels])
        assert (left <= step + 1e-6).all()


def test_every_code_is_its_own_point_and_comes_back():
    quantizer = plain((4, 3, 2), 2)
    books = quantizer.codebooks()
    assert books.shape == (2, 24, 3)
    assert len(books[0].unique(dim=0)) == 24
    inside = books[0] * 0.999999  # tanh reaches 1 nowhere
    assert torch.equal(quantizer.encode(torch.atanh(inside))[:, 0], torch.arange(24))
    summed = books[0][3] + books[1][7]
    torch.testing.assert_close(quantizer.look_up(torch.tensor([3, 7])), summed)


def test_fewer_layers_leave_the_others_out_and_gradients_pass():
    quantizer = build()
    latents = torch.randn(2, 7, 6, generator=torch.Generator().manual_seed(1)).requires_grad_()
    mask = torch.ones(2, 7, dtype=torch.bool)
    entries, codes, lost = quantizer(latents, mask, torch.tensor([1, 3]))
    torch.testing.assert_close(entries[0], quantizer.look_up(codes[0, :, :1]))
    torch.testing.assert_close(entries[1], quantizer.look_up(codes[1]))
    assert not lost.requires_grad
    entries.sum().backward()
    smooth = torch.autograd.functional.jacobian(
        lambda x: quantizer.outward(torch.tanh(quantizer.inward(x))).sum(), latents.detach()
    )
    torch.testing.assert_close(latents.grad, smooth)  # as if nothing had been rounded
    assert quantizer.inward.weight.grad is not None


@pytest.mark.parametrize("levels", [[8, 8], [512, 1], [8, 8.0, 8], [True, 512], [-8, -64]])
def test_levels_multiply_to_the_size(levels):
    with pytest.raises(InputError, match=r"residual_tokenizer.levels.*codebook_size \(512\)"):
        check_levels("residual_tokenizer.levels", levels, 512)
