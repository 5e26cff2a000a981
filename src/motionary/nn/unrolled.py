"""A weight that multiplies at every step of a recurrence: its gradient as one product over all steps.

Left to autograd, each step adds a weight-sized gradient of its own; on a CPU those products of few rows, and the sums
of them, cost more than the rest of the backward pass. Where the loop cannot be written as one operation (attention on
the previous state, samples that are read back), this still puts the weight's share behind it.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn
from torch.autograd.function import once_differentiable


class _Ticket(torch.autograd.Function):
    """Stands for weight and bias inside the loop. Autograd runs its backward last, when all steps have left theirs."""

    @staticmethod
    def forward(ctx, weight, bias, steps):  # type: ignore[override]
        """A scalar that every step takes, so that this backward comes after all of theirs."""
        ctx.steps = steps
        return weight.new_zeros(())

    @staticmethod
    @once_differentiable
    def backward(ctx, grad):  # type: ignore[override]
        """Gradients of weight and bias: one product over all steps."""
        inputs, grads = (torch.cat(parts) for parts in zip(*ctx.steps, strict=True))
        ctx.steps.clear()
        return grads.t() @ inputs, grads.sum(0), None


class _Product(torch.autograd.Function):
    """x (R, i) -> x W' + b; leaves (x, gradient of the result) for the ticket."""

    @staticmethod
    def forward(ctx, x, ticket, weight, bias, steps):  # type: ignore[override]
        """The product of one step."""
        ctx.save_for_backward(x, weight)
        ctx.steps = steps
        return torch.addmm(bias, x, weight.t())

    @staticmethod
    @once_differentiable
    def backward(ctx, grad):  # type: ignore[override]
        """The input's gradient; the weight's share is left for the ticket."""
        x, weight = ctx.saved_tensors
        ctx.steps.append((x, grad))
        return grad @ weight if ctx.needs_input_grad[0] else None, grad.new_zeros(()), None, None, None


class Unrolled:
    """`nn.Linear` for one run of a loop: call it with (R, i) at each step. Make a new one for each run.

    Results and gradients are those of the plain layer. On CUDA, and without gradients, it is the plain layer.
    """

    def __init__(self, weight: Tensor, bias: Tensor):
        self.weight, self.bias = weight, bias
        self.steps: list[tuple[Tensor, Tensor]] = []
        collects = torch.is_grad_enabled() and weight.requires_grad and not weight.is_cuda
        self.ticket = _Ticket.apply(weight, bias, self.steps) if collects else None

    @classmethod
    def of(cls, layer: nn.Linear) -> Unrolled:
        """Of a linear layer with a bias."""
        return cls(layer.weight, layer.bias)

    def __call__(self, x: Tensor) -> Tensor:
        if self.ticket is None:
            return F.linear(x, self.weight, self.bias)
        return _Product.apply(x, self.ticket, self.weight, self.bias, self.steps)  # type: ignore[return-value]


class UnrolledGRU:
    """`nn.GRUCell` for one run of a loop: (input (R, i), hidden (R, h)) -> hidden (R, h)."""

    def __init__(self, cell: nn.GRUCell):
        self.inputs, self.hidden = Unrolled(cell.weight_ih, cell.bias_ih), Unrolled(cell.weight_hh, cell.bias_hh)

    def __call__(self, x: Tensor, hidden: Tensor) -> Tensor:
        width = hidden.shape[1]
        (gates, new), (hidden_gates, hidden_new) = (
            product.split([2 * width, width], dim=1) for product in (self.inputs(x), self.hidden(hidden))
        )
        reset, update = torch.sigmoid(gates + hidden_gates).chunk(2, dim=1)
        return torch.lerp(torch.tanh(torch.addcmul(new, reset, hidden_new)), hidden, update)
