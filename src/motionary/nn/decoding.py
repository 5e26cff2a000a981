"""Turning a next-token model into sequences: greedy, sampling and beam search, for words and motion tokens alike.

A model offers :class:`Decoder`: `step` consumes one token per row and returns the logits of the next, with whatever it
caches (keys and values, or a recurrent state); `reorder` keeps, repeats or drops rows of that cache. Rows that have
ended leave the batch, so nothing is computed for them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import torch
from torch import Tensor

from motionary.errors import InputError


class Decoder(Protocol):
    """A model that continues sequences one token at a time. Never changes a state in place that it was given twice."""

    def step(self, state: Any, tokens: Tensor) -> tuple[Tensor, Any]:
        """Consume tokens (R,) -> logits (R, V) of the next token, and the new state."""
        ...

    def reorder(self, state: Any, index: Tensor) -> Any:
        """The state whose row i is row index[i] of `state`; rows may be repeated, permuted or dropped."""
        ...


class Averaged:
    """One decoder out of several models, and of several sources that mean the same to each.

    Every row stands for `ways` neighboring rows of each model and continues by the mean of their distributions. Its
    state is a list of those of the models.
    """

    def __init__(self, models: Sequence[Decoder], ways: int = 1):
        self.models, self.ways = models, ways

    def step(self, state: list[Any], tokens: Tensor) -> tuple[Tensor, list[Any]]:
        """See :class:`Decoder`."""
        tokens = tokens.repeat_interleave(self.ways)
        steps = [model.step(own, tokens) for model, own in zip(self.models, state, strict=True)]
        scores = torch.stack([torch.log_softmax(logits.float(), dim=-1) for logits, _ in steps])
        mean = scores.unflatten(1, (-1, self.ways)).logsumexp((0, 2)) - math.log(len(self.models) * self.ways)
        return mean, [own for _, own in steps]

    def reorder(self, state: list[Any], index: Tensor) -> list[Any]:
        """See :class:`Decoder`."""
        way = torch.arange(self.ways, device=index.device)
        rows = (index[:, None] * self.ways + way).flatten()
        return [model.reorder(own, rows) for model, own in zip(self.models, state, strict=True)]


@dataclass(frozen=True)
class Sampling:
    """How a token is drawn from its distribution.

    Attributes:
        temperature: divides the logits; 1 is the model's own distribution.
        top_k: only the k likeliest tokens; 0 keeps all.
        top_p: only the likeliest tokens whose probabilities reach p together; 1 keeps all.
    """

    temperature: float = 1.0
    top_k: int = 0
    top_p: float = 1.0

    def __post_init__(self):
        if not 0 < self.temperature < float("inf"):
            raise InputError(
                "temperature", self.temperature, "must be a number above 0 (for the likeliest token use greedy)"
            )
        if self.top_k < 0:
            raise InputError("top_k", self.top_k, "must not be negative (0 keeps all)")
        if not 0 < self.top_p <= 1:
            raise InputError("top_p", self.top_p, "must be in (0, 1]")

    def draw(self, logits: Tensor, noise: Tensor) -> Tensor:
        """Tokens (R,) from logits (R, V) by inverting the cumulative distribution at `noise` (R,), uniform in [0, 1).

        One number per token, so a row's outcome is its own and not its neighbors'.
        """
        logits = logits.double()
        # The likeliest is put to 0 first: no temperature, however small, makes it infinite.
        probabilities = torch.softmax((logits - logits.amax(-1, keepdim=True)) / self.temperature, dim=-1)
        if not self.top_k and self.top_p == 1:
            return _invert(probabilities, noise)
        probabilities, tokens = probabilities.sort(dim=-1, descending=True, stable=True)
        if self.top_k:
            probabilities = probabilities[:, : self.top_k]
        if self.top_p < 1:
            reached = probabilities.cumsum(-1) - probabilities
            probabilities = probabilities.masked_fill(reached >= self.top_p, 0)
        return tokens.gather(1, _invert(probabilities, noise)[:, None])[:, 0]


def _invert(weights: Tensor, noise: Tensor) -> Tensor:
    """First column whose cumulative weight exceeds noise x total; columns of weight zero are never chosen."""
    cumulative = weights.cumsum(-1)
    point = noise.to(cumulative)[:, None] * cumulative[:, -1:]
    # The product can round up to the total itself: the last column with weight then stands in.
    point = torch.minimum(point, torch.nextafter(cumulative[:, -1:], torch.zeros_like(point)))
    return torch.searchsorted(cumulative, point, right=True)[:, 0]


@torch.no_grad()
def sample(
    decoder: Decoder,
    state: Any,
    start: Tensor,
    end: int,
    noise: Tensor | None,
    steps: int,
    sampling: Sampling | None = None,
    banned: Sequence[int] = (),
    lengths: Tensor | None = None,
) -> tuple[Tensor, Tensor]:
    """Continue every row until it draws `end`, at most `steps` tokens and at least one.

    Args:
        decoder: the model; `state` is its state before the first step.
        start: (R,) first tokens, on the model's device.
        end: the token that ends a sequence; it is drawn like any other, not only where it is the likeliest.
        noise: (R, >= steps) uniform numbers, or None for the likeliest token (greedy).
        sampling: temperature, top_k and top_p.
        banned: tokens that are never chosen.
        lengths: (R,) forces each row to exactly so many tokens (between 1 and steps).

    Returns:
        tokens (R, steps), filled with `end` after each row's last token, and lengths (R,) without the end.
    """
    sampling = sampling or Sampling()
    rows = torch.arange(len(start), device=start.device)
    out = torch.full((len(start), steps), end, dtype=torch.long, device=start.device)
    found = torch.zeros_like(rows)
    last = start
    for step in range(steps):
        if len(rows) == 0:
            break
        logits, state = decoder.step(state, last)
        logits = logits.clone()
        logits[:, list(banned)] = -torch.inf
        if step == 0 or lengths is not None:
            logits[:, end] = -torch.inf
        if noise is None:
            last = logits.argmax(-1)
        else:
            # Where the noise lives, the CPU: some devices have no float64.
            last = sampling.draw(logits.to(noise.device), noise[rows.to(noise.device), step]).to(logits.device)
        alive = last != end
        out[rows, step] = last
        found[rows[alive]] = step + 1
        if lengths is not None:
            alive &= lengths[rows] > step + 1
        if not bool(alive.all()):
            keep = alive.nonzero()[:, 0]
            rows, last, state = rows[keep], last[keep], decoder.reorder(state, keep)
    return out, found


@dataclass
class Hypothesis:
    """A finished sequence without its end token, and its log-probability divided by the length penalty."""

    tokens: list[int]
    score: float


@torch.no_grad()
def beam_search(
    decoder: Decoder,
    state: Any,
    start: Tensor,
    end: int,
    beams: int = 2,
    n: int = 1,
    steps: int = 30,
    penalty: float = 0.7,
    banned: Sequence[int] = (),
) -> list[list[Hypothesis]]:
    """The best sequences of every item, by log-probability / (tokens with the end) ** penalty.

    All items and beams are one batch. A beam that ends moves to its item's list of finished ones and is no longer
    scored; an item leaves the batch once no live beam can still enter that list. After `steps` tokens only the end is
    allowed, so a sentence that was cut pays for ending there.

    Args:
        decoder: the model; `state` is its state before the first step, one row per item.
        start: (B,) first tokens.
        end: the token that ends a sequence (never the first).
        beams: live beams per item.
        n: sequences to return per item.
        steps: most tokens before the end.
        penalty: exponent of the length penalty; 0 compares plain log-probabilities.
        banned: tokens that are never chosen.

    Returns:
        for each item at most n hypotheses, best first (fewer only where fewer sequences exist).
    """
    if beams < 1 or n < 1:
        raise InputError("beams, n", (beams, n), "must both be at least 1")
    search = _Search(len(start), max(beams, n), n, steps, penalty, end, start.device)
    width = search.width
    state = decoder.reorder(state, search.items.repeat_interleave(width))
    last = start.repeat_interleave(width)
    for step in range(steps + 1):
        logits, state = decoder.step(state, last)
        logits = logits.clone()
        logits[:, list(banned)] = -torch.inf
        if step == 0:
            logits[:, end] = -torch.inf
        scores = torch.log_softmax(logits.float(), dim=-1).unflatten(0, (-1, width))
        search.finish(scores[..., end], step + 1)
        if step == steps:
            break
        last, rows = search.extend(scores, step + 1)
        if len(rows) == 0:
            break
        state = decoder.reorder(state, rows)
    return search.results()


class _Search:
    """Live and finished beams of every item. Live ones carry plain log-probabilities, finished ones their score."""

    def __init__(self, items: int, width: int, n: int, steps: int, penalty: float, end: int, device: torch.device):
        self.width, self.n, self.steps, self.penalty, self.end = width, n, steps, penalty, end
        self.items = torch.arange(items, device=device)  # items that are still searched
        self.tokens = torch.full((items, width, steps), end, dtype=torch.long, device=device)
        self.scores = torch.full((items, width), -torch.inf, device=device)
        self.scores[:, 0] = 0  # all beams start equal: let only one of them branch
        self.best = torch.full((items, n), -torch.inf, device=device)
        self.best_tokens = torch.full((items, n, steps), end, dtype=torch.long, device=device)

    def finish(self, end_scores: Tensor, length: int) -> None:
        """Offer every live beam, ended here with log-probability end_scores (L, W), to the finished lists."""
        ended = (self.scores + end_scores) / length**self.penalty
        merged = torch.cat((self.best[self.items], ended), dim=1)
        tokens = torch.cat((self.best_tokens[self.items], self.tokens), dim=1)
        best, index = merged.topk(self.n, dim=1)
        self.best[self.items] = best
        self.best_tokens[self.items] = tokens.gather(1, index[..., None].expand(-1, -1, self.steps))

    def extend(self, scores: Tensor, length: int) -> tuple[Tensor, Tensor]:
        """Grow the live beams by their best continuations; returns last tokens and the decoder rows they grow from."""
        words = scores.shape[-1]
        scores = scores.clone()
        scores[..., self.end] = -torch.inf
        total, index = (self.scores[..., None] + scores).flatten(1).topk(self.width, dim=1)
        parent, token = index // words, index % words
        # A live beam's best end: no further loss, and the largest divisor (scores are negative).
        bound = total[:, 0] / (self.steps + 1) ** self.penalty
        keep = (bound > self.best[self.items, -1]).nonzero()[:, 0]
        rows = (keep[:, None] * self.width + parent[keep]).flatten()
        self.tokens = self.tokens[keep[:, None], parent[keep]]
        self.tokens[..., length - 1] = token[keep]
        self.scores, self.items = total[keep], self.items[keep]
        return token[keep].flatten(), rows

    def results(self) -> list[list[Hypothesis]]:
        """The finished lists, best first."""
        return [
            [
                Hypothesis([t for t in row if t != self.end], score)
                for row, score in zip(rows, scores, strict=True)
                if score > -float("inf")
            ]
            for rows, scores in zip(self.best_tokens.tolist(), self.best.tolist(), strict=True)
        ]
