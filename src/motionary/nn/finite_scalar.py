"""A quantizer without a codebook to learn: a few numbers, each rounded to a few levels (FSQ: Mentzer et al., 2024).

In layers, each rounds what the ones before it left over on a grid that much finer, so that no code is ever unused and
nothing has to start, follow or restart.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor, nn

from motionary.errors import InputError
from motionary.nn.layers import masked_mean
from motionary.nn.precision import widened
from motionary.nn.residual_quantizer import NO_CODE


def check_levels(name: str, levels: Sequence[int], count: int) -> None:
    """InputError unless `levels` are two or more steps each, `count` points altogether; `name` is the setting's."""
    whole = all(isinstance(level, int) and not isinstance(level, bool) and level >= 2 for level in levels)
    if not whole or math.prod(levels) != count:
        raise InputError(name, list(levels), f"must be whole numbers from 2, whose product is codebook_size ({count})")


class FiniteScalarQuantizer(nn.Module):
    """L layers on grids of prod(levels) points; offers what :class:`~motionary.nn.residual_quantizer.ResidualQuantizer`
    does.

    A latent becomes z = tanh(A x), of one number for each entry of `levels` (FSQ's f, on [-1, 1]). The first layer
    rounds z to the grid of levels[i] even steps from -1 to 1. What is left lies within one step to each side, and the
    next layer rounds it on the same grid, levels[i] - 1 times as fine. Entries return through a linear map without
    offset, so that those of several layers add up.

    Args:
        levels: numbers of steps, 2 or more each; 8, 8, 8 are 512 codes a layer.
        dim: d of the latents.
        layers: L.
    """

    levels: Tensor
    place: Tensor
    started = True  # from its first step, unlike codebooks

    def __init__(self, levels: Sequence[int], dim: int, layers: int):
        super().__init__()
        self.inward, self.outward = nn.Linear(dim, len(levels)), nn.Linear(len(levels), dim, bias=False)
        self.count, self.depth = math.prod(levels), layers
        steps = torch.tensor(levels, dtype=torch.long)
        self.register_buffer("levels", steps, persistent=False)
        place = torch.cat([steps.new_ones(1), steps.cumprod(0)[:-1]])  # the first number changes fastest
        self.register_buffer("place", place, persistent=False)

    def codebooks(self) -> Tensor:
        """(L, K, d) the entries of every layer."""
        codes = torch.arange(self.count, device=self.levels.device)
        return torch.stack([self.outward(self._points(codes, layer)) for layer in range(self.depth)])

    def encode(self, latents: Tensor) -> Tensor:
        """(..., d) -> (..., L) codes, the first layer's first."""
        return self._round(self._bounded(latents))[1]

    def look_up(self, codes: Tensor) -> Tensor:
        """(..., L') codes of the first L' layers, or `NO_CODE` -> (..., d), the sum of their entries."""
        points = [self._points(code, layer) for layer, code in enumerate(codes.clamp(min=0).unbind(-1))]
        layers = [p * there for p, there in zip(points, (codes != NO_CODE)[..., None].unbind(-2), strict=True)]
        return self.outward(torch.stack(layers).sum(0))

    def forward(self, latents: Tensor, mask: Tensor, kept: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """latents (B, S, d), mask (B, S) of valid steps, kept (B,) layers that each item uses -> the sum of the entries
        (B, S, d), whose gradient passes the rounding straight through, codes (B, S, L), and the mean square of what
        rounding lost, a measure without gradient: there is nothing to commit to."""
        bounded = self._bounded(latents)  # (B, S, k)
        points, codes = self._round(bounded.detach())  # (L, B, S, k), (B, S, L)
        used = torch.arange(self.depth, device=kept.device)[:, None] < kept  # (L, B)
        rounded = (points * used[..., None, None]).sum(0)
        lost = masked_mean((bounded.detach() - rounded).square(), mask)
        return self.outward(bounded + (rounded - bounded).detach()), codes, lost

    def start(self, latents: Tensor, generator: torch.Generator) -> None:
        """Nothing: a grid needs no data."""

    def restart(self, generator: torch.Generator) -> None:
        """Nothing: no point of a grid dies."""

    def _bounded(self, latents: Tensor) -> Tensor:
        """(..., d) -> (..., k) on [-1, 1], in 32 bits."""
        return torch.tanh(widened(self.inward(latents)))

    def _round(self, bounded: Tensor) -> tuple[Tensor, Tensor]:
        """(..., k) -> the points of each layer (L, ..., k) and their codes (..., L)."""
        left, points, codes = bounded, [], []
        for layer in range(self.depth):
            half = (self.levels - 1) / 2
            index = ((left / self._scale(layer) + 1) * half).round().long()
            index = torch.minimum(index.clamp(min=0), self.levels - 1)
            codes.append((index * self.place).sum(-1))
            points.append(self._points(codes[-1], layer))
            left = left - points[-1]
        return torch.stack(points), torch.stack(codes, -1)

    def _points(self, codes: Tensor, layer: int) -> Tensor:
        """(...) codes of a layer -> (..., k) their points."""
        index = codes[..., None] // self.place % self.levels
        return (2 * index / (self.levels - 1) - 1) * self._scale(layer)

    def _scale(self, layer: int) -> Tensor:
        """(k,) half the width of what a layer has to round."""
        return (self.levels - 1.0) ** -layer
