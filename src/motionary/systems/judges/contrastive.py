"""Contrastive losses of matched texts and motions: Eq. 8 of TM2T, and symmetric InfoNCE."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

from motionary.nn.precision import full_precision


def margin_loss(text: Tensor, motion: Tensor, same: Tensor, shift: int, margin: float) -> Tensor:
    """Eq. 8 over the matched pairs and as many pairs of motion i with text i + shift.

    Its norms are read as distances, as in the authors' code: d^2 for matches, max(0, m - d)^2 for mismatches. Shifted
    pairs whose captions are equal (`same` (B, B)) are no mismatches and are left out.
    """
    matched = (text - motion).norm(dim=-1).square()  # (B,)
    index = (torch.arange(len(text), device=text.device) + shift) % len(text)
    mismatch = ~same[torch.arange(len(text), device=text.device), index]
    pushed = (margin - (text[index] - motion).norm(dim=-1)).clamp(min=0).square()  # (B,)
    return (matched.sum() + (pushed * mismatch).sum()) / (len(text) + mismatch.sum())


def infonce_loss(text: Tensor, motion: Tensor, same: Tensor, temperature: float) -> Tensor:
    """Symmetric InfoNCE on cosines; texts that are the `same` (B, B) as a pair's own are no negatives for it."""
    with full_precision(text):  # a temperature of 0.1 makes ten times as much of every error
        cosines = F.normalize(motion, dim=-1) @ F.normalize(text, dim=-1).t() / temperature  # (B, B) motion by text
    cosines = cosines.masked_fill(same & ~diagonal(same), -torch.inf)
    target = torch.arange(len(text), device=text.device)
    return 0.5 * (F.cross_entropy(cosines, target) + F.cross_entropy(cosines.t(), target))


def first_share(text: Tensor, motion: Tensor, same: Tensor) -> Tensor:
    """Share of motions whose own text is the nearest of those that are not the `same` (B, B)."""
    distance = torch.cdist(motion.detach(), text.detach()).masked_fill(same & ~diagonal(same), torch.inf)
    return (distance.argmin(1) == torch.arange(len(text), device=text.device)).float().mean()


def diagonal(same: Tensor) -> Tensor:
    """(B, B) true on the diagonal."""
    return torch.eye(len(same), dtype=torch.bool, device=same.device)
