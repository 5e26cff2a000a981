"""A quantizer in layers: each codes what the ones before it left over (Zeghidour et al., 2021; MoMask Eq. 1-3)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

import torch
from torch import Tensor, nn

from motionary.nn.quantizer import Quantizer

NO_CODE = -1  # of a layer that says nothing about a place


class ResidualQuantizer(nn.Module):
    """L layers of K codes of d dimensions, learned by running means with restarts (see :class:`Quantizer`).

    Args:
        codes, dim, layers: K, d and L.
        decay, dead: of every layer's running means and restarts.
        shared: the layers after the base share one codebook.
    """

    def __init__(self, codes: int, dim: int, layers: int, decay: float, dead: float, shared: bool = False):
        super().__init__()
        made = [Quantizer(codes, dim, "ema", decay, dead) for _ in range(min(layers, 2) if shared else layers)]
        self.layers = nn.ModuleList(made + made[1:] * (layers - len(made)))

    def __iter__(self) -> Iterator[Quantizer]:
        return iter(cast(list[Quantizer], list(self.layers)))

    def codebooks(self) -> Tensor:
        """(L, K, d) the entries of every layer."""
        return torch.stack([layer.codebook for layer in self])

    def encode(self, latents: Tensor) -> Tensor:
        """(..., d) -> (..., L) codes, the base's first."""
        left, codes = latents, []
        for layer in self:
            codes.append(layer.nearest(left))
            left = left - layer.look_up(codes[-1])
        return torch.stack(codes, -1)

    def look_up(self, codes: Tensor) -> Tensor:
        """(..., L') codes of the first L' layers, or `NO_CODE` -> (..., d), the sum of their entries."""
        layers = list(self)[: codes.shape[-1]]
        told = zip(layers, codes.clamp(min=0).unbind(-1), (codes != NO_CODE)[..., None].unbind(-2), strict=True)
        return torch.stack([layer.look_up(code) * there for layer, code, there in told]).sum(0)

    def forward(self, latents: Tensor, mask: Tensor, kept: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """latents (B, S, d), mask (B, S) of valid steps, kept (B,) layers that each item uses -> the sum of the entries
        with straight-through gradient (B, S, d), codes (B, S, L), and the commitment loss, the mean over layers. Only
        what an item uses moves its codes."""
        left, total, codes, losses = latents, torch.zeros_like(latents), [], []
        for index, layer in enumerate(self):
            used = mask & (kept > index)[:, None]  # (B, S)
            quantized, found, _, commitment = layer(left, used)
            entries = quantized.detach() * used[..., None]
            left, total = left - entries, total + entries
            codes.append(found)
            losses.append(commitment)
        return latents + (total - latents).detach(), torch.stack(codes, -1), torch.stack(losses).mean()

    @property
    def started(self) -> bool:
        """The codebooks were drawn from encoder outputs."""
        return all(bool(layer.started) for layer in self)

    @torch.no_grad()
    def start(self, latents: Tensor, generator: torch.Generator) -> None:
        """Draw every layer's codes from what latents (N, d) leave over (:meth:`Quantizer.start`)."""
        left = latents
        for layer in self:
            if not bool(layer.started):
                layer.start(left, generator)
            left = left - layer.look_up(layer.nearest(left))

    def restart(self, generator: torch.Generator) -> None:
        """Move codes that are hardly chosen to recent latents (:meth:`Quantizer.restart`)."""
        for layer in self:  # a shared one finds nothing to do the second time
            layer.restart(generator)
