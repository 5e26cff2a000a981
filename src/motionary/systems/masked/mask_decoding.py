"""From masked places to tokens: the plan in a few passes, then the other layers in one pass each (MoMask 3.2, 3.3)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from motionary.nn.decoding import Sampling
from motionary.nn.layers import length_mask
from motionary.nn.residual_quantizer import NO_CODE
from motionary.systems.masked.flow_detail import FlowDetail, codes_of, normal_from
from motionary.systems.masked.masked_generator import MaskedGenerator
from motionary.systems.masked.masked_networks import Memory, ResidualDetail, Text
from motionary.systems.masked.masking import masked_counts
from motionary.systems.masked.text_guidance import TextGuidance

Logits = Callable[[Memory, list[tuple[Tensor, Tensor]]], Tensor]  # of one pass, given what the text says


@dataclass(frozen=True)
class Drawing:
    """How tokens are chosen.

    Attributes:
        sampling: of base codes; None takes the likeliest, places in the order of their probabilities alone.
        guidance: scale of classifier-free guidance (Ho and Salimans, 2022) of base codes; 1 is off.
        detail: sampling of the codes of the other layers; None takes the likeliest.
        detail_guidance: its scale there.
    """

    sampling: Sampling | None
    guidance: float
    detail: Sampling | None
    detail_guidance: float


def draws_needed(model: MaskedGenerator) -> int:
    """Uniform numbers that one motion takes, whatever its length."""
    config = model.config
    detail = config.code_dim if config.detail == "flow" else config.layers - 1
    return (2 * config.iterations + detail) * model.context.max_tokens


@torch.no_grad()
def fill(
    model: MaskedGenerator,
    text: Text,
    told: Tensor,
    codes: Tensor,
    known: Tensor,
    count: Tensor,
    noise: Tensor,
    drawing: Drawing,
) -> Tensor:
    """Codes (B, S, L) with all places of `count` (B,) filled, `NO_CODE` in layers that are not told, zero beyond.

    Args:
        text: of each item; `told` (B,) bool says which have one.
        codes: (B, S, L), which count where `known` (B, S) is true.
        noise: (B, draws_needed) uniform in [0, 1), one row of its own for each item.
    """
    valid = length_mask(count, codes.shape[1])
    noise = noise.unflatten(1, (-1, model.context.max_tokens))[..., : codes.shape[1]]  # (B, passes, S)
    passes = 2 * model.config.iterations
    guided = TextGuidance(model.text, model.plan.reader, text, told, drawing.guidance)
    layers = [_plan(model, guided, codes[..., 0], valid & ~known, count, noise[:, :passes], drawing) * valid]
    if model.config.layers > 1:
        guided = TextGuidance(model.text, model.detail.reader, text, told, drawing.detail_guidance)
        detail = _flow if isinstance(model.detail, FlowDetail) else _residual
        layers += detail(model, guided, layers[0], codes, known, count, noise[:, passes:], drawing)
    untold = torch.where(known[..., None], codes[..., len(layers) :], NO_CODE)
    return torch.cat((torch.stack(layers, -1), untold), -1) * valid[..., None]


def _residual(
    model: MaskedGenerator,
    guided: TextGuidance,
    base: Tensor,
    codes: Tensor,
    known: Tensor,
    count: Tensor,
    noise: Tensor,
    drawing: Drawing,
) -> list[Tensor]:
    """The codes (B, S) of each layer after the base, one after another, by noise (B, L - 1, S)."""
    layers, so_far, network = [], F.embedding(base, model.codebooks[0]), model.detail  # (B, S, d)
    assert isinstance(network, ResidualDetail)
    for level in range(1, model.config.layers):
        codebook = model.codebooks[level]

        def scores(x: Tensor, *rest, level: int = level, codebook: Tensor = codebook) -> Tensor:
            """Log-probabilities (B, S, K) of the layer's codes."""
            return network.logits(network(x, level, *rest), level, codebook).log_softmax(-1)

        drawn = _choose(guided(scores, so_far, count), noise[:, level - 1], drawing.detail)
        layers.append(torch.where(known, codes[..., level], drawn))
        so_far = so_far + F.embedding(layers[-1], codebook)
    return layers


def _flow(
    model: MaskedGenerator,
    guided: TextGuidance,
    base: Tensor,
    codes: Tensor,
    known: Tensor,
    count: Tensor,
    noise: Tensor,
    drawing: Drawing,
) -> list[Tensor]:
    """The codes (B, S) of each layer after the base, all together, by noise (B, d, S)."""
    network, temperature = model.detail, drawing.detail.temperature if drawing.detail else 0.0
    assert isinstance(network, FlowDetail)
    codes = codes[..., : model.config.layers]
    # Codes at unknown places may be any number.
    entries = model.entries(torch.cat((base[..., None], codes[..., 1:] * known[..., None]), -1))
    start = temperature * normal_from(noise.mT).to(entries)

    def velocity(x: Tensor, time: Tensor) -> Tensor:
        """Guided by the text."""
        return guided(lambda x, *rest: network(x, time, *rest), x, count)

    rest = network.draw(velocity, entries, known, start, model.config.flow_steps)
    drawn = codes_of(rest, model.codebooks[1 : model.config.layers])
    return list(torch.where(known[..., None], codes[..., 1:], drawn).unbind(-1))


def _plan(
    model: MaskedGenerator,
    guided: TextGuidance,
    codes: Tensor,
    hidden: Tensor,
    count: Tensor,
    noise: Tensor,
    drawing: Drawing,
) -> Tensor:
    """Base codes (B, S): after each pass the surest stay, and as many are masked again as the schedule says."""
    steps, mask = model.config.iterations, model.config.codebook_size
    unknown = hidden.sum(1)  # (B,)
    codes = codes.masked_fill(hidden, mask)
    for step in range(steps):
        scores = guided(lambda *given: model.plan(*given).log_softmax(-1), codes, count)
        drawn = _choose(scores, noise[:, 2 * step], drawing.sampling)
        sure = scores.log_softmax(-1).gather(-1, drawn[..., None])[..., 0]
        if drawing.sampling is not None:
            # Gumbel noise that dies down lets the first choices be others each time.
            sure = sure - (1 - (step + 1) / steps) * (-(noise[:, 2 * step + 1].to(sure) + 1e-9).log() + 1e-9).log()
        codes = torch.where(hidden, drawn, codes)
        again = masked_counts(unknown, (step + 1) / steps)
        rank = sure.masked_fill(~hidden, torch.inf).argsort(1).argsort(1)  # the least sure first
        hidden = hidden & (rank < again[:, None])
        codes = codes.masked_fill(hidden, mask)
    return codes


def _choose(scores: Tensor, noise: Tensor, sampling: Sampling | None) -> Tensor:
    """(B, S) codes from log-probabilities (B, S, K), by noise (B, S) or the likeliest."""
    if sampling is None:
        return scores.argmax(-1)
    # Where the noise lives, the CPU: some devices have no float64.
    drawn = sampling.draw(scores.flatten(0, 1).to(noise.device), noise.flatten())
    return drawn.view(scores.shape[:2]).to(scores.device)
