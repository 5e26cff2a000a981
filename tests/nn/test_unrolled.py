"""Weights that all steps share get the gradients that autograd gives them step by step."""

import pytest
import torch
from torch import nn

from motionary.nn.recurrent import BiGRU
from motionary.nn.unrolled import StepCell, StepLinear, unrolling


class Recurrence(nn.Module):
    """A cell that reads what a linear layer makes of its own state."""

    def __init__(self, bias: bool = True):
        super().__init__()
        self.cell, self.out = StepCell(3, 4), StepLinear(4, 3, bias=bias)

    def forward(self, x: torch.Tensor, hidden: torch.Tensor, steps: int) -> torch.Tensor:
        for _ in range(steps):
            hidden = self.cell(x, hidden)
            x = self.out(hidden).tanh()
        return hidden


@pytest.fixture
def given():
    torch.manual_seed(0)
    return torch.randn(5, 3, dtype=torch.double), torch.randn(5, 4, dtype=torch.double, requires_grad=True)


def gradients(model, given, steps=6):
    x, hidden = given
    model.zero_grad()
    found = model(x, hidden, steps)
    of_state = torch.autograd.grad(found.square().sum(), [hidden, *model.parameters()])
    return [found.detach(), *of_state]


@pytest.mark.parametrize("bias", [True, False])
def test_gradients_are_those_of_every_step_added_up(given, bias):
    model = Recurrence(bias).double()
    plain = gradients(model, given)
    for _ in range(2):  # nothing is left of the first
        with unrolling(model):
            shared = gradients(model, given)
        for found, expected in zip(shared, plain, strict=True):
            torch.testing.assert_close(found, expected, rtol=1e-12, atol=1e-12)


def test_gradients_are_those_of_finite_differences(given):
    model = Recurrence().double()

    def loss(*weights):
        return torch.func.functional_call(model, dict(zip(names, weights, strict=True)), (*given, 3)).sum()

    names, weights = zip(*model.named_parameters(), strict=True)
    with unrolling(model):
        found = torch.autograd.grad(model(*given, 3).sum(), weights)
    for k, weight in enumerate(weights):
        change, step = torch.randn_like(weight), 1e-6
        moved = [[w + sign * step * change if j == k else w for j, w in enumerate(weights)] for sign in (1, -1)]
        slope = (loss(*moved[0]) - loss(*moved[1])) / (2 * step)
        assert (found[k] * change).sum().item() == pytest.approx(slope.item(), rel=1e-6)


def test_layers_are_their_own_again_afterwards(given):
    model = Recurrence().double()
    before = model(*given, 2)
    with pytest.raises(ZeroDivisionError), unrolling(model):
        raise ZeroDivisionError
    assert model.cell.shared is model.out.shared is None
    with torch.no_grad(), unrolling(model):
        assert model.cell.shared is None  # nothing to gain
        assert torch.equal(model(*given, 2), before)


def test_a_layer_that_takes_no_part_gets_no_gradient(given):
    model = Recurrence().double()
    with unrolling(model):
        model.cell(*given).sum().backward()
    assert model.out.weight.grad is None
    assert model.cell.weight_hh.grad is not None


def test_products_are_narrow_and_gradients_are_not(given):
    model = Recurrence()
    x, hidden = (part.float() for part in given)
    exact = torch.autograd.grad(model(x, hidden, 6).square().sum(), model.parameters())
    with torch.autocast("cpu", torch.bfloat16), unrolling(model):
        found = model(x, hidden, 6)
        near = torch.autograd.grad(found.square().sum(), model.parameters())
    assert found.dtype == torch.float32
    for one, other in zip(near, exact, strict=True):
        assert one.dtype == torch.float32
        assert not torch.equal(one, other)
        torch.testing.assert_close(one, other, rtol=0.05, atol=0.03 * float(other.abs().max()))


def test_training_reads_sequences_as_use_does():
    torch.manual_seed(0)
    layer, x, lengths = BiGRU(5, 7).double(), torch.randn(4, 9, 5, dtype=torch.double), torch.tensor([3, 9, 1, 6])
    trained = (*layer(x, lengths), layer.last(x, lengths))
    with torch.no_grad():
        used = (*layer(x, lengths), layer.last(x, lengths))
    for one, other in zip(trained, used, strict=True):
        torch.testing.assert_close(one.detach(), other, rtol=1e-12, atol=1e-12)
