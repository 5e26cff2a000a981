"""Snippet codes: the convolutional encoder and decoder of four frames to a code (thesis 4.2.1, Eq. 4.1)."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn

from motionary.nn.convolutions import Down, Up, coarser, finer, keep, step_mask
from motionary.nn.layers import Normalizer

CONTACTS = 4  # the last features: both ankles and toes
UNIT = 4  # frames to a code


class SnippetEncoder(nn.Module):
    """E of Eq. 4.1."""

    def __init__(self, width: int, code_dim: int, hide_contacts: bool, mean: Any, std: Any):
        super().__init__()
        self.normalizer = Normalizer(mean, std)
        self.hidden = CONTACTS if hide_contacts else 0
        self.first = Down(len(self.normalizer.mean) - self.hidden, width)
        self.second = Down(width, code_dim)
        self.output = nn.Linear(code_dim, code_dim)

    def forward(self, raw: Tensor, frames: Tensor | None = None) -> Tensor:
        """raw (B, T, D), frames (B,) | None -> codes (B, T/4, code_dim), zero beyond the frames."""
        x, mask = prepare(self.normalizer(raw), frames)
        x = x[:, : x.shape[1] - self.hidden]
        half = coarser(mask)
        quarter = coarser(half)
        codes = self.output(self.second(self.first(x, half), quarter).transpose(1, 2))
        return codes if quarter is None else codes * quarter.transpose(1, 2)


class SnippetDecoder(nn.Module):
    """D of Eq. 4.1."""

    def __init__(self, width: int, code_dim: int, features: int):
        super().__init__()
        self.first = Up(code_dim, width, transposed=True)
        self.second = Up(width, features, transposed=True)
        self.output = nn.Linear(features, features)

    def forward(self, codes: Tensor, count: Tensor | None = None) -> Tensor:
        """codes (B, S, code_dim), count (B,) | None -> normalized features (B, 4S, D)."""
        x = codes.transpose(1, 2)
        quarter = step_mask(count, x)
        half = finer(quarter)
        full = finer(half)
        x = self.second(self.first(keep(x, quarter), half), full)
        out = self.output(x.transpose(1, 2))
        return out if full is None else out * full.transpose(1, 2)


def prepare(normalized: Tensor, frames: Tensor | None) -> tuple[Tensor, Tensor | None]:
    """(B, T, D) -> channels first (B, D, T'), T' a multiple of the unit, zero beyond the frames, and its mask."""
    steps = normalized.shape[1] // UNIT * UNIT
    x = normalized[:, :steps].transpose(1, 2)
    mask = None if frames is None else step_mask(torch.div(frames, UNIT, rounding_mode="floor") * UNIT, x)
    return keep(x, mask), mask
