"""Convolutions over time for batches of different lengths: steps beyond an item's length stay zero in every layer.

Zero is also what a convolution pads with, so an item gives the same result alone and beside longer ones. A mask is
(B, 1, T) with ones at valid steps, or None where all are valid.
"""

from __future__ import annotations

from torch import Tensor, nn
from torch.nn import functional as F

from motionary.nn.layers import length_mask

SLOPE = 0.2  # of every leaky rectifier (TM2T Table 3)


def keep(x: Tensor, mask: Tensor | None) -> Tensor:
    """x (B, C, T) with zeros where the mask has them."""
    return x if mask is None else x * mask


def step_mask(lengths: Tensor | None, x: Tensor) -> Tensor | None:
    """(B,) valid steps of x (B, C, T) -> its mask, or None where all steps are valid."""
    if lengths is None or bool((lengths >= x.shape[-1]).all()):
        return None
    return length_mask(lengths, x.shape[-1])[:, None].to(x.dtype)


def coarser(mask: Tensor | None) -> Tensor | None:
    """The mask after a convolution of stride 2 (lengths are multiples of the strides)."""
    return None if mask is None else mask[..., ::2]


def finer(mask: Tensor | None) -> Tensor | None:
    """The mask after doubling the steps."""
    return None if mask is None else mask.repeat_interleave(2, dim=-1)


class ResBlock(nn.Module):
    """x + Conv(LeakyReLU(Conv(x))), both of width 3 (TM2T Table 3); the first may be dilated."""

    def __init__(self, width: int, dilation: int = 1):
        super().__init__()
        self.first = nn.Conv1d(width, width, 3, padding=dilation, dilation=dilation)
        self.second = nn.Conv1d(width, width, 3, padding=1)

    def forward(self, x: Tensor, mask: Tensor | None = None) -> Tensor:
        """(B, C, T) -> (B, C, T), zero where the mask is."""
        hidden = keep(F.leaky_relu(self.first(x), SLOPE), mask)
        return x + keep(self.second(hidden), mask)


class Down(nn.Module):
    """Convolution of width 4 and stride 2 with a leaky rectifier: (B, C, T) -> (B, C', T/2)."""

    def __init__(self, inputs: int, outputs: int):
        super().__init__()
        self.convolution = nn.Conv1d(inputs, outputs, 4, stride=2, padding=1)

    def forward(self, x: Tensor, mask: Tensor | None = None) -> Tensor:
        """`mask` belongs to the result."""
        return keep(F.leaky_relu(self.convolution(x), SLOPE), mask)


class Up(nn.Module):
    """Doubles the steps: nearest neighbour then a convolution of width 3 (TM2T), or a transposed one of width 4."""

    def __init__(self, inputs: int, outputs: int, transposed: bool = False):
        super().__init__()
        self.transposed = transposed
        if transposed:
            self.convolution = nn.ConvTranspose1d(inputs, outputs, 4, stride=2, padding=1)
        else:
            self.convolution = nn.Conv1d(inputs, outputs, 3, padding=1)

    def forward(self, x: Tensor, mask: Tensor | None = None) -> Tensor:
        """`mask` belongs to the result."""
        if not self.transposed:
            x = x.repeat_interleave(2, dim=-1)
        return keep(F.leaky_relu(self.convolution(x), SLOPE), mask)
