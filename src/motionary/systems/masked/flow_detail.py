"""What the layers after the base say together, by a flow from noise (rectified flow: Liu et al., 2023).

The residual transformer tells the other layers one after another, each in a pass of its own; this network refines their
sum in a few steps, which then falls to the nearest codes, so that tokens stay what they are everywhere else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import torch
from torch import Tensor, nn

from motionary.nn.layers import masked_mean
from motionary.nn.quantizer import nearest_code
from motionary.systems.masked.flow_head import time_encoding
from motionary.systems.masked.masked_networks import Memory, TokenReader

_EDGE = 1e-6  # of the uniform numbers, beside which a normal one would be infinite


class FlowDetail(nn.Module):
    """The velocity at which noise becomes the sum of the entries after the base, given the base's entries.

    On the way x_t = (1 - t) x_0 + t x_1, with x_0 of a standard normal and x_1 the sum over its deviation, it is
    x_1 - x_0.
    """

    scale: Tensor

    def __init__(self, dim: int, reader: TokenReader, width: int):
        super().__init__()
        self.input, self.reader, self.output = nn.Linear(2 * dim, width), reader, nn.Linear(width, dim)
        self.time = nn.Linear(width, width)
        self.width = width
        nn.init.zeros_(self.output.weight)
        nn.init.zeros_(self.output.bias)
        self.register_buffer("scale", torch.ones(2))  # root mean square of the base's entries, and of the sum

    @torch.no_grad()
    def take_codebooks(self, codebooks: Tensor) -> None:
        """The tokenizer's entries (L, K, d): layers after the base vary by themselves, so squares add up."""
        squares = codebooks.square().mean((1, 2))
        self.scale.copy_(torch.stack((squares[0], squares[1:].sum())).sqrt().clamp(min=1e-6))

    def forward(
        self, x: Tensor, time: Tensor, count: Tensor, memory: Memory, text: Sequence[tuple[Tensor, Tensor]]
    ) -> Tensor:
        """x (B, S, 2d): the base's entries over their deviation and x_t; time () or (B,) in 0..1 -> velocity (B, S,
        d)."""
        at = self.time(time_encoding(time.expand(len(x)), self.width).to(x.dtype))
        return self.output(self.reader(self.input(x) + at[:, None], count, memory, text))

    def loss(self, entries: Tensor, valid: Tensor, memory: Memory, generator: torch.Generator) -> Tensor:
        """Mean square error of the velocity at one random time of each item; entries (B, S, L, d), valid (B, S)."""
        base, rest = entries[:, :, 0] / self.scale[0], entries[:, :, 1:].sum(2) / self.scale[1]
        start = torch.randn(rest.shape, generator=generator, device=rest.device)
        time = torch.rand(len(rest), generator=generator, device=rest.device)
        between = torch.lerp(start, rest, time[:, None, None])
        told = self(torch.cat((base, between), -1), time, valid.sum(1), memory, self.reader.read(memory))
        return masked_mean((told.float() - (rest - start)).square(), valid)

    def draw(
        self, velocity: Callable[[Tensor, Tensor], Tensor], entries: Tensor, known: Tensor, start: Tensor, steps: int
    ) -> Tensor:
        """The sum of the entries after the base (B, S, d), in so many Euler steps.

        Args:
            velocity: x (B, S, 2d) and the time () -> (B, S, d), guided by the text.
            entries: (B, S, L, d); those after the base count where `known` (B, S) is true, and are kept on the way.
            start: x_0 (B, S, d).
        """
        base, rest = entries[:, :, 0] / self.scale[0], entries[:, :, 1:].sum(2) / self.scale[1]
        x = start
        for step in range(steps):
            time = torch.tensor(step / steps, device=x.device)
            x = torch.where(known[..., None], torch.lerp(start, rest, time), x)
            x = x + velocity(torch.cat((base, x), -1), time) / steps
        return x * self.scale[1]


def normal_from(uniform: Tensor) -> Tensor:
    """Uniform numbers in [0, 1) -> standard normal ones, each from its own."""
    return torch.erfinv(2 * uniform.clamp(_EDGE, 1 - _EDGE) - 1) * 2**0.5


def codes_of(rest: Tensor, codebooks: Tensor) -> Tensor:
    """(..., d) sums of entries -> (..., L) codes, each layer the nearest to what the ones before it left over."""
    left, codes = rest, []
    for codebook in codebooks:
        codes.append(nearest_code(left, codebook))
        left = left - codebook[codes[-1]]
    return torch.stack(codes, -1)
