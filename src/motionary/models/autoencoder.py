"""Motion snippet codes: a convolutional autoencoder, four frames to a code (thesis 4.2.1, Eq. 4.1-4.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn

from motionary.errors import InputError
from motionary.models.convolutions import Down, Up, coarser, finer, keep, step_mask
from motionary.models.layers import Normalizer, length_mask, masked_mean

CONTACTS = 4  # the last features: both ankles and toes
UNIT = 4  # frames to a code


@dataclass(frozen=True)
class AutoencoderConfig:
    """Attributes:
    width: channels between the two convolutions.
    code_dim: dimensions of a snippet code.
    sparsity: weight of the codes' L1 norm (Eq. 4.2); 0 leaves the term out.
    smoothness: weight of the L1 norm of the difference of neighbouring codes (Eq. 4.2); 0 leaves it out.
    hide_contacts: the encoder does not see the foot contacts, the decoder predicts them.
    position_weight: extra weight of the local joint positions in the reconstruction (0: the thesis).
    square_from: see :func:`distance` (0: the thesis).
    """

    width: int = 512
    code_dim: int = 512
    sparsity: float = 0.001
    smoothness: float = 0.001
    hide_contacts: bool = True
    position_weight: float = 0.0
    square_from: float = 0.0

    def __post_init__(self) -> None:
        if self.square_from < 0:
            raise InputError("autoencoder.square_from", self.square_from, "must be at least 0")


class SnippetEncoder(nn.Module):
    """E of Eq. 4.1."""

    def __init__(self, config: AutoencoderConfig, mean: Any, std: Any):
        super().__init__()
        self.normalizer = Normalizer(mean, std)
        self.hidden = CONTACTS if config.hide_contacts else 0
        self.first = Down(len(self.normalizer.mean) - self.hidden, config.width)
        self.second = Down(config.width, config.code_dim)
        self.output = nn.Linear(config.code_dim, config.code_dim)

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

    def __init__(self, config: AutoencoderConfig, features: int):
        super().__init__()
        self.first = Up(config.code_dim, config.width, transposed=True)
        self.second = Up(config.width, features, transposed=True)
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


def feature_weights(features: int, joints: int, position_weight: float) -> Tensor:
    """(D,) weights of a reconstruction loss, mean 1: local joint positions weigh 1 + position_weight before scaling."""
    weights = torch.ones(features)
    weights[4 : 4 + 3 * (joints - 1)] += position_weight
    return weights / weights.mean()


def distance(difference: Tensor, square_from: float) -> Tensor:
    """Elementwise reconstruction error of normalized features: L1 (Eq. 4.2), or squared where it is large.

    A positive `square_from` makes errors beyond that many deviations count by their square, continued smoothly (the
    reverse Huber function). Under L1 alone a network that trains for minutes settles on the median, which leaves out
    what few clips do for a short time: turning around, waving, clapping.
    """
    error = difference.abs()
    if not square_from:
        return error
    return torch.where(error < square_from, error, (error.square() / square_from + square_from) / 2)


def position_error(decoded: Tensor, raw: Tensor, frames: Tensor, joints: int) -> Tensor:
    """Mean error of the local joint positions (root and heading removed), in millimetres.

    Compares the features' own local positions, with the root's height; the root joint counts through its height only.
    """
    count = joints - 1
    a, b = decoded[..., 4 : 4 + 3 * count], raw[:, : decoded.shape[1], 4 : 4 + 3 * count]
    error = (a - b).unflatten(-1, (count, 3)).norm(dim=-1).sum(-1)
    return 1000 * masked_mean(error / joints, length_mask(frames, decoded.shape[1]))


class Autoencoder(nn.Module):
    """Snippet codes and back (Eq. 4.1). Features cross its borders raw.

    encode(raw (B, T, D), frames (B,)) -> codes (B, T/4, code_dim); decode(codes, count (B,)) -> raw (B, 4S, D).
    """

    weights: Tensor

    def __init__(self, config: AutoencoderConfig, context: Any):
        super().__init__()
        self.config, self.context = config, context
        self.encoder = SnippetEncoder(config, context.mean, context.std)
        features = len(self.encoder.normalizer.mean)
        self.decoder = SnippetDecoder(config, features)
        self.joints = len(context.skeleton.joints)
        weights = feature_weights(features, self.joints, config.position_weight)
        self.register_buffer("weights", weights, persistent=False)

    def encode(self, raw: Tensor, frames: Tensor | None = None) -> Tensor:
        """Snippet codes of raw features, zero beyond an item's frames."""
        return self.encoder(raw, frames)

    def decode(self, codes: Tensor, count: Tensor | None = None) -> Tensor:
        """Raw features of snippet codes."""
        return self.encoder.normalizer.inverse(self.decoder(codes, count))

    def loss(self, batch: Any, progress: float, generator: torch.Generator) -> tuple[Tensor, dict[str, Tensor]]:
        """Eq. 4.2, as means over valid frames and features (codes and dimensions) in place of sums."""
        return self._loss(batch)[:2]

    def _loss(self, batch: Any) -> tuple[Tensor, dict[str, Tensor], Tensor]:
        codes = self.encode(batch.motion, batch.frames)
        count = torch.div(batch.frames, UNIT, rounding_mode="floor")
        output = self.decoder(codes, count)
        target = self.encoder.normalizer(batch.motion[:, : output.shape[1]])
        mask = length_mask(count * UNIT, output.shape[1])
        terms = {"reconstruction": masked_mean(distance(output - target, self.config.square_from) * self.weights, mask)}
        valid = length_mask(count, codes.shape[1])
        terms["sparsity"] = masked_mean(codes.abs(), valid)
        terms["smoothness"] = masked_mean((codes[:, 1:] - codes[:, :-1]).abs(), valid[:, 1:])
        loss = (
            terms["reconstruction"]
            + self.config.sparsity * terms["sparsity"]
            + self.config.smoothness * terms["smoothness"]
        )
        return loss, {name: value.detach() for name, value in terms.items()}, output

    @torch.no_grad()
    def validate(self, batch: Any) -> dict[str, Tensor]:
        """The loss, its terms and the position error in millimetres."""
        loss, terms, output = self._loss(batch)
        decoded = self.encoder.normalizer.inverse(output)
        error = position_error(decoded, batch.motion, batch.frames // UNIT * UNIT, self.joints)
        return {"loss": loss, **terms, "position_mm": error}


MODEL, CONFIG = Autoencoder, AutoencoderConfig
