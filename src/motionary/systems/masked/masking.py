"""Which tokens a masked model has to tell: scattered ones by a cosine schedule, or whole spans (MoMask 3.2)."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from motionary.nn.layers import length_mask


def masked_counts(count: Tensor, share: Tensor | float) -> Tensor:
    """(B,) tokens of `count` (B,) that are masked where a share (B,) of the steps is done: count cos(share pi / 2)."""
    share = torch.as_tensor(share, dtype=torch.float64, device=count.device)
    return (count * torch.cos(share * (math.pi / 2))).floor().long()


def scattered(count: Tensor, steps: int, generator: torch.Generator) -> Tensor:
    """(B, steps) bool: in each item a random number of its `count` tokens at random places, at least one."""
    share = torch.rand(len(count), generator=generator, device=count.device)
    number = masked_counts(count, share).clamp(min=1)
    order = torch.rand(len(count), steps, generator=generator, device=count.device)
    order = order.masked_fill(~length_mask(count, steps), 2.0)  # padding comes last
    return order.argsort(1).argsort(1) < number[:, None]


def spans(count: Tensor, steps: int, generator: torch.Generator) -> Tensor:
    """(B, steps) bool: in each item one span: all, from the first token on, up to the last, or in the middle.

    What is left is what control keeps: nothing, the end, the beginning, both.
    """
    kind, length, place = torch.rand(3, len(count), generator=generator, device=count.device)
    kind = (4 * kind).long()
    number = 1 + (length * count).long().clamp(max=count - 1)  # 1 .. count
    number = torch.where(kind == 0, count, number)
    first = torch.stack([torch.zeros_like(count), torch.zeros_like(count), count - number])
    middle = (place * (count - number + 1)).long()
    first = torch.cat([first, middle[None]]).gather(0, kind[None])[0]
    at = torch.arange(steps, device=count.device)
    return (at >= first[:, None]) & (at < (first + number)[:, None])


def training_mask(count: Tensor, steps: int, span_share: float, generator: torch.Generator) -> Tensor:
    """(B, steps) bool: spans in about `span_share` of the items, scattered tokens in the others."""
    spanned = torch.rand(len(count), generator=generator, device=count.device) < span_share
    some, whole = scattered(count, steps, generator), spans(count, steps, generator)
    return torch.where(spanned[:, None], whole, some)


def corrupted(
    codes: Tensor, hidden: Tensor, mask_code: int, random_share: float, kept_share: float, generator: torch.Generator
) -> Tensor:
    """Codes (B, S) with `mask_code` where `hidden`; shares of these are other codes or stay, as in BERT, so that no
    code is taken for certain."""
    draws = torch.rand(codes.shape, generator=generator, device=codes.device)
    others = torch.randint(mask_code, codes.shape, generator=generator, device=codes.device)
    told = torch.where(draws < random_share, others, torch.full_like(codes, mask_code))
    told = torch.where(draws >= 1 - kept_share, codes, told)
    return torch.where(hidden, told, codes)
