"""The three networks of stylization: content encoder, style encoder and generator (thesis 5.2.2, Fig. 5.2a).

Like the convolutions they are made of, they leave steps beyond an item's length at zero and out of every statistic,
so that an item's result does not depend on the batch. Channels come first: (B, C, steps); masks are (B, 1, steps).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from motionary.nn.convolutions import SLOPE, Down, coarser, finer, keep
from motionary.nn.precision import widened

# Added to variances. With the usual 1e-5 a channel that hardly moves over the few steps of a short stretch comes out
# 300 times as large, layer upon layer: gradients grow to 10^5 (the test tells), and after clipping nothing is learned.
EPSILON = 1e-2


def instance_norm(x: Tensor, mask: Tensor | None = None) -> Tensor:
    """Each channel of each item to mean 0 and variance 1 over its valid steps; zero beyond them and where constant;
    in 32 bits."""
    x = widened(x)
    if mask is None:
        away = x - x.mean(-1, keepdim=True)
        return away * (away.square().mean(-1, keepdim=True) + EPSILON).rsqrt()
    count = mask.sum(-1, keepdim=True).clamp(min=1)
    away = keep(x - keep(x, mask).sum(-1, keepdim=True) / count, mask)
    return away * (away.square().sum(-1, keepdim=True) / count + EPSILON).rsqrt()


def adaptive_norm(x: Tensor, gain: Tensor, bias: Tensor, mask: Tensor | None = None) -> Tensor:
    """AdaIN: instance normalization, then deviation `gain` and mean `bias` (B, C) for each channel."""
    return keep(gain[..., None] * instance_norm(x, mask) + bias[..., None], mask)


class ContentEncoder(nn.Module):
    """E_c: codes (B, D_z, S) -> content (B, D_c, S/2). Instance normalization after every layer, the last included,
    erases each channel's mean and deviation, which is where style lives; time stays."""

    def __init__(self, codes: int, width: int, content: int, blocks: int):
        super().__init__()
        self.down = nn.Conv1d(codes, width, 4, stride=2, padding=1)
        self.blocks = nn.ModuleList(
            nn.ModuleList(nn.Conv1d(width, width, 3, padding=1) for _ in range(2)) for _ in range(blocks)
        )
        self.output = nn.Conv1d(width, content, 1)

    def forward(self, codes: Tensor, mask: Tensor | None = None) -> Tensor:
        """`mask` belongs to the codes."""
        mask = coarser(mask)
        x = F.leaky_relu(instance_norm(keep(self.down(codes), mask), mask), SLOPE)
        for first, second in self.blocks:  # type: ignore[misc]
            hidden = F.leaky_relu(instance_norm(keep(first(x), mask), mask), SLOPE)
            x = x + instance_norm(keep(second(hidden), mask), mask)
        return instance_norm(keep(self.output(x), mask), mask)


class StyleEncoder(nn.Module):
    """E_s: codes (B, D_z, S), label (B,) | None -> mean and log-variance (B, D_s) of N_s.

    Two convolutions, the average over time, then dense layers; the label's embedding joins after the average.
    """

    RECEPTIVE = 6  # codes that one step before the average sees

    def __init__(self, codes: int, width: int, style: int, labels: int):
        super().__init__()
        self.first = nn.Conv1d(codes, width, 3, padding=1)
        self.down = Down(width, width)
        self.hidden = nn.Linear(width, width)
        self.label = nn.Embedding(labels, width) if labels else None
        self.output = nn.Linear(width, 2 * style)

    def forward(self, codes: Tensor, label: Tensor | None, mask: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """`mask` belongs to the codes."""
        x = keep(F.leaky_relu(self.first(codes), SLOPE), mask)
        x, mask = self.down(x, coarser(mask)), coarser(mask)
        x = widened(x)
        pooled = x.mean(-1) if mask is None else x.sum(-1) / mask.sum(-1).clamp(min=1)
        hidden = self.hidden(pooled)
        if self.label is not None:
            hidden = hidden + self.label(label)
        mean, log_variance = widened(self.output(F.leaky_relu(hidden, SLOPE))).chunk(2, -1)
        return mean, log_variance


class Generator(nn.Module):
    """G: content (B, D_c, S/2) and style (B, W) of :meth:`style` -> codes (B, D_z, S).

    Residual blocks, then twice the steps; AdaIN after every layer but the last.
    """

    def __init__(self, codes: int, width: int, content: int, style: int, blocks: int, labels: int):
        super().__init__()
        self.code = nn.Linear(style, width)
        self.label = nn.Embedding(labels, width) if labels else None
        self.mapping = nn.Linear(width, width)
        layers = 2 * blocks + 2
        self.affine = nn.Linear(width, layers * 2 * width)
        with torch.no_grad():  # start at gain 1 and bias 0
            self.affine.weight.mul_(0.5)
            self.affine.bias.zero_()
        self.input = nn.Conv1d(content, width, 1)
        self.blocks = nn.ModuleList(
            nn.ModuleList(nn.Conv1d(width, width, 3, padding=1) for _ in range(2)) for _ in range(blocks)
        )
        self.up = nn.Conv1d(width, width, 3, padding=1)
        self.output = nn.Conv1d(width, codes, 3, padding=1)

    def style(self, code: Tensor, label: Tensor | None) -> Tensor:
        """Style code (B, D_s) and label (B,) as one vector (B, W): what :meth:`forward` takes, and what may be mixed
        between two styles."""
        hidden = self.code(code)
        return hidden if self.label is None else hidden + self.label(label)

    def forward(self, content: Tensor, style: Tensor, mask: Tensor | None = None) -> Tensor:
        """`mask` belongs to the content."""
        hidden = F.leaky_relu(self.mapping(F.leaky_relu(style, SLOPE)), SLOPE)
        gains, biases = self.affine(hidden).unflatten(-1, (2, -1, self.mapping.out_features)).unbind(1)
        layer = iter(zip((1 + gains).unbind(1), biases.unbind(1), strict=True))
        x = F.leaky_relu(adaptive_norm(keep(self.input(content), mask), *next(layer), mask), SLOPE)
        for first, second in self.blocks:  # type: ignore[misc]
            inner = F.leaky_relu(adaptive_norm(keep(first(x), mask), *next(layer), mask), SLOPE)
            x = x + adaptive_norm(keep(second(inner), mask), *next(layer), mask)
        x, mask = x.repeat_interleave(2, -1), finer(mask)
        x = F.leaky_relu(adaptive_norm(keep(self.up(x), mask), *next(layer), mask), SLOPE)
        return widened(keep(self.output(x), mask))
