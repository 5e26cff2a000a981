"""The three networks of TEMOS (3.2): encoders of a sequence to one distribution, and the decoder of one latent.

Each has a recurrent form, the row "GRU" of Table 3. Deviations from the paper, all in the Transformers:

- layers normalize their input, and dropout acts on the outputs of branches (see :mod:`motionary.nn.transformer`);
- the outputs of the distribution tokens pass a linear layer each before they are mean and log-variance, since pre-norm
  outputs all have one scale;
- the decoder's attention on its memory is a linear layer. The memory is one latent: a softmax over one key is 1
  whatever the query, so that attention gives out(value(z)) in every frame, and two linear layers in a row are one.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.utils.rnn import pack_padded_sequence

from motionary.nn.gaussian import Gaussian, gaussian
from motionary.nn.layers import length_mask, positional_encoding
from motionary.nn.transformer import Attention, EncoderLayer, FeedForward

START_LOG_VARIANCE = -3.0  # of an untrained encoder: a latent that is mostly its mean is learned from sooner


class SequenceEncoder(nn.Module):
    """A sequence to the distribution of its latent by a Transformer with learnt distribution tokens.

    Args:
        inputs: dimensions of a step.
        latent: dimensions of z and of the Transformer.
        layers, heads, inner, dropout: of the Transformer.
        variational: two tokens, for mean and log-variance; False has one, for the latent itself.
    """

    def __init__(
        self, inputs: int, latent: int, layers: int, heads: int, inner: int, dropout: float, variational: bool = True
    ):
        super().__init__()
        tokens = 2 if variational else 1
        self.input = nn.Linear(inputs, latent)
        self.tokens = nn.Parameter(torch.randn(tokens, latent))
        self.layers = nn.ModuleList(EncoderLayer(latent, heads, inner, dropout) for _ in range(layers))
        self.norm = nn.LayerNorm(latent)
        self.heads = nn.ModuleList(nn.Linear(latent, latent) for _ in range(tokens))
        self.dropout = nn.Dropout(dropout)
        _start(self.heads)

    def forward(self, x: Tensor, count: Tensor) -> Gaussian:
        """x (B, T, inputs), valid steps (B,) -> distribution over (B, latent); padding changes nothing."""
        tokens = self.tokens.expand(len(x), -1, -1)
        x = torch.cat((tokens, self.input(x)), dim=1)  # (B, tokens + T, latent)
        steps = torch.arange(x.shape[1], device=x.device)
        x = self.dropout(x + positional_encoding(steps, x.shape[-1]))
        mask = length_mask(count + tokens.shape[1], x.shape[1])[:, None, None]
        for layer in self.layers:
            x = layer(x, mask)
        out = self.norm(x[:, : tokens.shape[1]])
        return _distribution([head(out[:, i]) for i, head in enumerate(self.heads)])


class RecurrentEncoder(nn.Module):
    """The same by a GRU whose last state is read ("GRU" of Table 3); arguments as :class:`SequenceEncoder`."""

    def __init__(self, inputs: int, latent: int, layers: int, dropout: float, variational: bool = True):
        super().__init__()
        self.input = nn.Linear(inputs, latent)
        self.unit = nn.GRU(latent, latent, layers, batch_first=True, dropout=dropout if layers > 1 else 0.0)
        self.heads = nn.ModuleList(nn.Linear(latent, latent) for _ in range(2 if variational else 1))
        _start(self.heads)

    def forward(self, x: Tensor, count: Tensor) -> Gaussian:
        """x (B, T, inputs), valid steps (B,) -> distribution over (B, latent)."""
        packed = pack_padded_sequence(self.input(x), count.cpu(), batch_first=True, enforce_sorted=False)
        last = self.unit(packed)[1][-1]
        return _distribution([head(last) for head in self.heads])


class LatentLayer(nn.Module):
    """Self-attention over the frames, the latent's share, and feed-forward, each added to its input."""

    def __init__(self, latent: int, heads: int, inner: int, dropout: float):
        super().__init__()
        self.attention = Attention(latent, heads)
        self.from_latent = nn.Linear(latent, latent)
        self.forward_part = FeedForward(latent, inner)
        self.norms = nn.ModuleList(nn.LayerNorm(latent) for _ in range(2))
        self.dropout = nn.Dropout(dropout)

    def forward(self, x: Tensor, z: Tensor, mask: Tensor) -> Tensor:
        """x (B, F, latent), z (B, latent), mask (B, 1, 1, F) of valid frames -> (B, F, latent)."""
        normal = self.norms[0](x)
        x = x + self.dropout(self.attention(normal, *self.attention.keys_values(normal), mask))
        x = x + self.dropout(self.from_latent(z)[:, None])
        return x + self.dropout(self.forward_part(self.norms[1](x)))


class SequenceDecoder(nn.Module):
    """A latent and a duration to all frames at once, from sinusoids as queries (3.2); not autoregressive."""

    def __init__(self, outputs: int, latent: int, layers: int, heads: int, inner: int, dropout: float):
        super().__init__()
        self.layers = nn.ModuleList(LatentLayer(latent, heads, inner, dropout) for _ in range(layers))
        self.norm = nn.LayerNorm(latent)
        self.output = nn.Linear(latent, outputs)

    def forward(self, z: Tensor, frames: Tensor) -> Tensor:
        """z (B, latent), frames (B,) -> (B, F, outputs), zero beyond each duration."""
        valid = length_mask(frames, int(frames.max()))
        x = _queries(z, valid.shape[1]).expand(len(z), -1, -1)
        for layer in self.layers:
            x = layer(x, z, valid[:, None, None])
        return self.output(self.norm(x)) * valid[..., None]


class RecurrentDecoder(nn.Module):
    """The same by a GRU that reads the latent beside each frame's sinusoid ("GRU" of Table 3)."""

    def __init__(self, outputs: int, latent: int, layers: int, dropout: float):
        super().__init__()
        self.unit = nn.GRU(latent, latent, layers, batch_first=True, dropout=dropout if layers > 1 else 0.0)
        self.output = nn.Linear(latent, outputs)

    def forward(self, z: Tensor, frames: Tensor) -> Tensor:
        """z (B, latent), frames (B,) -> (B, F, outputs), zero beyond each duration."""
        valid = length_mask(frames, int(frames.max()))
        return self.output(self.unit(z[:, None] + _queries(z, valid.shape[1]))[0]) * valid[..., None]


def _queries(z: Tensor, frames: int) -> Tensor:
    """(1, F, latent) sinusoids of the frames."""
    return positional_encoding(torch.arange(frames, device=z.device), z.shape[-1])[None]


def _start(heads: nn.ModuleList) -> None:
    if len(heads) == 2:
        nn.init.constant_(heads[1].bias, START_LOG_VARIANCE)  # type: ignore[arg-type]


def _distribution(parameters: list[Tensor]) -> Gaussian:
    """One tensor is a latent that is certain: a variance of zero."""
    if len(parameters) == 2:
        return gaussian(torch.cat(parameters, dim=-1))
    return Gaussian(parameters[0], torch.full_like(parameters[0], -torch.inf))
