"""Snippet codes: the convolutional encoder and decoder of four frames to a code (thesis 4.2.1, Eq. 4.1)."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from motionary.features import UNIT, Columns, width
from motionary.nn.convolutions import Down, Up, coarser, finer, keep, step_mask
from motionary.nn.layers import Normalizer
from motionary.nn.precision import widened


class SnippetEncoder(nn.Module):
    """E of Eq. 4.1.

    Args:
        channels: between the two convolutions.
        code_dim: dimensions of a code.
        seen: columns of the features that it reads.
        mean, std: of the features, (D,) each.
    """

    def __init__(self, channels: int, code_dim: int, seen: Columns, mean: np.ndarray, std: np.ndarray):
        super().__init__()
        self.normalizer, self.seen = Normalizer(mean, std), seen
        self.first = Down(width(seen), channels)
        self.second = Down(channels, code_dim)
        self.output = nn.Linear(code_dim, code_dim)

    def forward(self, raw: Tensor, frames: Tensor | None = None) -> Tensor:
        """raw (B, T, D), frames (B,) | None -> codes (B, T/4, code_dim), zero beyond the frames."""
        x, mask = prepare(self.normalizer(raw), frames)  # (B, D, T)
        half = coarser(mask)
        quarter = coarser(half)
        codes = self.second(self.first(x[:, self.seen], half), quarter)  # (B, code_dim, T/4)
        codes = widened(self.output(codes.transpose(1, 2)))
        return codes if quarter is None else codes * quarter.transpose(1, 2)


class SnippetDecoder(nn.Module):
    """D of Eq. 4.1."""

    def __init__(self, channels: int, code_dim: int, features: int):
        super().__init__()
        self.first = Up(code_dim, channels, transposed=True)
        self.second = Up(channels, features, transposed=True)
        self.output = nn.Linear(features, features)

    def forward(self, codes: Tensor, count: Tensor | None = None) -> Tensor:
        """codes (B, S, code_dim), count (B,) | None -> normalized features (B, 4S, D)."""
        x = codes.transpose(1, 2)
        quarter = step_mask(count, x)
        half = finer(quarter)
        full = finer(half)
        x = self.second(self.first(keep(x, quarter), half), full)
        out = widened(self.output(x.transpose(1, 2)))
        return out if full is None else out * full.transpose(1, 2)


def prepare(normalized: Tensor, frames: Tensor | None) -> tuple[Tensor, Tensor | None]:
    """(B, T, D) -> channels first (B, D, T'), T' a multiple of the unit, zero beyond the frames, and its mask."""
    steps = normalized.shape[1] // UNIT * UNIT
    x = normalized[:, :steps].transpose(1, 2)
    mask = None if frames is None else step_mask(torch.div(frames, UNIT, rounding_mode="floor") * UNIT, x)
    return keep(x, mask), mask
