"""The moving average of the weights, which may be validated and kept in place of the last ones."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch
from torch import Tensor, nn


class WeightAverage:
    """Exponential moving average of a model's trainable weights; a decay of 0 turns it off.

    Attributes:
        values: the averages by parameter name; empty where it is off.
    """

    def __init__(self, model: nn.Module, decay: float):
        self.model, self.decay = model, decay
        self.values: dict[str, Tensor] = {n: p.detach().clone() for n, p in trained(model)} if decay else {}

    @torch.no_grad()
    def update(self, step: int) -> None:
        """After optimizer step number `step`, from 1."""
        # Early steps average over what there is, as in Adam's bias correction.
        decay = min(self.decay, (1 + step) / (10 + step))
        if self.values:
            for name, p in trained(self.model):
                self.values[name].lerp_(p, 1 - decay)

    @contextmanager
    def in_place(self) -> Iterator[None]:
        """The averaged weights in the model's place, for validating."""
        live = {name: p.detach().clone() for name, p in trained(self.model)} if self.values else {}
        self.keep()
        yield
        _assign(self.model, live)

    def keep(self) -> None:
        """The averaged weights become the model's."""
        _assign(self.model, self.values)


def trained(model: nn.Module) -> list[tuple[str, nn.Parameter]]:
    """The parameters that take gradients, with their names."""
    return [(name, p) for name, p in model.named_parameters() if p.requires_grad]


@torch.no_grad()
def _assign(model: nn.Module, values: dict[str, Tensor]) -> None:
    for name, parameter in model.named_parameters():
        if name in values:
            parameter.copy_(values[name])
