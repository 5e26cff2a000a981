"""Layers that a recurrence applies at every step, whose weights get their gradient in one product over all steps.

Step by step, autograd makes a gradient as large as the weight and adds it to the sum of those before: more memory to
move than the step's own products, on CPUs more than half of a recurrence's time.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from motionary.nn.precision import full_precision, narrow_type, widened

Pairs = list[tuple[Tensor, Tensor]]  # inputs (R, d) of steps, and the gradients (R, o) of their outputs


class _Lent(torch.autograd.Function):
    """A weight (o, d) for the steps, in their type. Runs backwards after all of them."""

    @staticmethod
    def forward(ctx: Any, weight: Tensor, kind: torch.dtype, pairs: Pairs) -> Tensor:
        """The weight in its type `kind`."""
        ctx.set_materialize_grads(False)
        ctx.pairs, ctx.kind = pairs, weight.dtype
        return weight.view_as(weight) if weight.dtype == kind else weight.to(kind)

    @staticmethod
    def backward(ctx: Any, *_: Tensor | None) -> tuple[Tensor | None, None, None]:
        """The gradient from all steps."""
        if not ctx.pairs:
            return None, None, None
        inputs, gradients = (torch.cat(part) for part in zip(*ctx.pairs, strict=True))
        ctx.pairs.clear()
        return (gradients.t() @ inputs).to(ctx.kind), None, None


class _Product(torch.autograd.Function):
    """x W^T of one step, which leaves the weight's gradient to :class:`_Lent`."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: Tensor, pairs: Pairs) -> Tensor:
        """(R, d), (o, d) -> (R, o)."""
        ctx.save_for_backward(x, weight)
        ctx.pairs = pairs
        return x @ weight.t()

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None, None]:
        """The input's gradient."""
        x, weight = ctx.saved_tensors
        ctx.pairs.append((x, gradients[0]))
        return gradients[0] @ weight, None, None


class Shared:
    """A linear layer for all steps of one recurrence, prepared once: in the type that autocast gives products."""

    def __init__(self, weight: Tensor, bias: Tensor | None):
        self._pairs: Pairs = []
        self._kind = narrow_type(weight) or weight.dtype
        self._weight, self._bias = _Lent.apply(weight, self._kind, self._pairs), bias

    def __call__(self, x: Tensor) -> Tensor:
        """(R, d) -> (R, o), in at least 32 bits."""
        with full_precision(x):
            out = widened(_Product.apply(x.to(self._kind), self._weight, self._pairs))  # type: ignore[arg-type]
            return out if self._bias is None else out + self._bias


class StepLinear(nn.Linear):
    """A linear layer that takes part in :func:`unrolling`."""

    shared: tuple[Shared, ...] | None = None

    def forward(self, x: Tensor) -> Tensor:  # type: ignore[override]
        """(R, d) -> (R, o)."""
        return super().forward(x) if self.shared is None else self.shared[0](x)

    def for_all_steps(self) -> tuple[Shared, ...]:
        """What `shared` holds while it is unrolled."""
        return (Shared(self.weight, self.bias),)


class StepCell(nn.GRUCell):
    """A gated recurrent unit (Cho et al., 2014) that takes part in :func:`unrolling`.

    Under autocast its products are narrow and its state is not: what is added to it at each of many steps is small.
    """

    shared: tuple[Shared, ...] | None = None

    def forward(self, x: Tensor, hidden: Tensor) -> Tensor:  # type: ignore[override]
        """One step: inputs (R, d), state (R, h) -> state (R, h)."""
        if self.shared is not None:
            return gated(self.shared[0](x), self.shared[1](hidden), hidden)
        if narrow_type(x) is None:
            return super().forward(x, hidden)
        given = F.linear(x, self.weight_ih, self.bias_ih)
        return gated(widened(given), widened(F.linear(hidden, self.weight_hh, self.bias_hh)), widened(hidden))

    def for_all_steps(self) -> tuple[Shared, ...]:
        """What `shared` holds while it is unrolled: of the input, and of the state."""
        return Shared(self.weight_ih, self.bias_ih), Shared(self.weight_hh, self.bias_hh)


def gated(given: Tensor, held: Tensor, hidden: Tensor) -> Tensor:
    """The new state (R, h) of a GRU from its products (R, 3h) with the input and with the state (R, h)."""
    reset_given, update_given, new_given = given.chunk(3, dim=1)
    reset_held, update_held, new_held = held.chunk(3, dim=1)
    new = torch.tanh(new_given + torch.sigmoid(reset_given + reset_held) * new_held)
    return new + torch.sigmoid(update_given + update_held) * (hidden - new)


@contextmanager
def unrolling(module: nn.Module) -> Iterator[None]:
    """While it lasts, the :class:`StepLinear` and :class:`StepCell` inside `module` share their weights' gradients."""
    steps = [part for part in module.modules() if isinstance(part, StepLinear | StepCell)]
    try:
        for part in steps if torch.is_grad_enabled() else ():
            part.shared = part.for_all_steps()
        yield
    finally:
        for part in steps:
            part.shared = None


def scan(unit: nn.GRU, x: Tensor, lengths: Tensor, suffix: str) -> Tensor:
    """States (B, T, h) of one direction of a one-layer GRU after each step, frozen (last) beyond each length.

    Args:
        unit: whose weights are taken.
        x: (B, T, d).
        lengths: (B,) valid steps.
        suffix: of the weights' names; "_reverse" goes backwards, from each last valid step.
    """
    w_in, w_state, b_in, b_state = (
        getattr(unit, f"{name}_l0{suffix}") for name in ("weight_ih", "weight_hh", "bias_ih", "bias_hh")
    )
    given = widened(F.linear(x, w_in, b_in)).unbind(1)
    state = Shared(w_state, b_state)
    hidden = given[0].new_zeros(len(x), unit.hidden_size)
    live = lengths.to(x.device)[:, None] > torch.arange(len(given), device=x.device)  # (B, T)
    states = [hidden] * len(given)
    for step in reversed(range(len(given))) if suffix else range(len(given)):
        hidden = torch.where(live[:, step, None], gated(given[step], state(hidden), hidden), hidden)
        states[step] = hidden
    return torch.stack(states, dim=1)
