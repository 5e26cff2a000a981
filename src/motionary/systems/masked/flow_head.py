"""What one place of a motion may be, as a flow from noise (Li et al., 2024; rectified flow: Liu et al., 2023)."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor, nn

from motionary.nn.layers import positional_encoding

_TIMES = 1000.0  # sinusoids tell whole steps apart; a time is in 0..1


def time_encoding(time: Tensor, dim: int) -> Tensor:
    """Sinusoids of times (...,) in 0..1 -> (..., dim)."""
    return positional_encoding(_TIMES * time, dim)


class Block(nn.Module):
    """A residual layer whose normalized input is shifted, scaled and gated by a condition (Peebles and Xie, 2023)."""

    def __init__(self, width: int):
        super().__init__()
        self.norm = nn.LayerNorm(width, elementwise_affine=False)
        self.condition = nn.Linear(width, 3 * width)
        self.layers = nn.Sequential(nn.Linear(width, width), nn.SiLU(), nn.Linear(width, width))
        nn.init.zeros_(self.condition.weight)
        nn.init.zeros_(self.condition.bias)

    def forward(self, x: Tensor, condition: Tensor) -> Tensor:
        """x (N, width), condition (N, width) -> (N, width)."""
        shift, scale, gate = self.condition(condition).chunk(3, -1)
        return x + gate * self.layers(self.norm(x) * (1 + scale) + shift)


class FlowHead(nn.Module):
    """The velocity at which noise becomes a code, given what a transformer says of its place.

    On the way x_t = (1 - t) x_0 + t x_1, with x_0 of a standard normal and x_1 the code, it is x_1 - x_0.

    Args:
        dim: of a code.
        told: dimensions of what the transformer says.
        width, blocks: of this network.
    """

    def __init__(self, dim: int, told: int, width: int, blocks: int):
        super().__init__()
        self.width = width
        self.input, self.told, self.time = nn.Linear(dim, width), nn.Linear(told, width), nn.Linear(width, width)
        self.blocks = nn.ModuleList(Block(width) for _ in range(blocks))
        self.norm, self.output = nn.LayerNorm(width), nn.Linear(width, dim)
        nn.init.zeros_(self.output.weight)
        nn.init.zeros_(self.output.bias)

    def forward(self, x: Tensor, time: Tensor, told: Tensor) -> Tensor:
        """x (N, dim) at time (N,) in 0..1, told (N, told) -> velocity (N, dim)."""
        at = self.time(time_encoding(time, self.width).to(x.dtype))
        told = self.told(told)
        condition, x = nn.functional.silu(told + at), self.input(x) + told
        for block in self.blocks:
            x = block(x, condition)
        return self.output(self.norm(x))

    def loss(self, codes: Tensor, told: Tensor, draws: int, generator: torch.Generator) -> Tensor:
        """Mean square error of the velocity; codes (N, dim), told (N, told), each at `draws` random times.

        Times are drawn by the logistic of a normal number: those in the middle are the hardest.
        """
        codes, told = codes.repeat(draws, 1), told.repeat(draws, 1)
        start = torch.randn(codes.shape, generator=generator, device=codes.device)
        time = torch.randn(len(codes), generator=generator, device=codes.device).sigmoid()
        velocity = self(torch.lerp(start, codes, time[:, None]), time, told)
        return (velocity.float() - (codes - start)).square().mean()


def flow(velocity: Callable[[Tensor, Tensor], Tensor], start: Tensor, steps: int) -> Tensor:
    """From noise (N, dim) to codes, in so many Euler steps of `velocity` (x (N, dim), time (N,)) -> (N, dim)."""
    x = start
    for step in range(steps):
        x = x + velocity(x, x.new_full((len(x),), step / steps)) / steps
    return x
