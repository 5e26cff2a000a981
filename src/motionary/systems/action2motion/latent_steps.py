"""What posterior, prior and generator share: an encoder, a GRU, and normal distributions over its outputs."""

from __future__ import annotations

import torch
from torch import Tensor, nn

LEAST, MOST = -12.0, 6.0  # logarithms of variances, so that the divergence and its gradient stay finite


class Recurrent(nn.Module):
    """A linear encoder E_n, a GRU and, where asked for, a linear layer after it (Eq. 3.7, 3.8)."""

    def __init__(self, inputs: int, width: int, layers: int, outputs: int = 0):
        super().__init__()
        self.encoder = nn.Linear(inputs, width)
        self.unit = nn.GRU(width, width, layers, batch_first=True)
        self.out = nn.Linear(width, outputs) if outputs else nn.Identity()

    def forward(self, x: Tensor, state: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Inputs (B, S, d) -> outputs (B, S, o) and the state after the last step; None starts from zero."""
        hidden, last = self.unit(self.encoder(x), state)
        return self.out(hidden), last


def moments(parameters: Tensor) -> tuple[Tensor, Tensor]:
    """(..., 2 z) -> mean and logarithm of the variance, (..., z) each."""
    mean, log_variance = parameters.chunk(2, -1)
    return mean, log_variance.clamp(LEAST, MOST)


def drawn(normal: tuple[Tensor, Tensor], noise: Tensor) -> Tensor:
    """A draw of normal distributions from standard normal noise of the same shape."""
    return normal[0] + noise * (0.5 * normal[1]).exp()


def divergence(q: tuple[Tensor, Tensor], p: tuple[Tensor, Tensor]) -> Tensor:
    """KL(q || p) (...,) in nats, summed over z's dimensions (the second term of Eq. 3.6)."""
    apart = (q[0] - p[0]).square() + q[1].exp()
    return 0.5 * (p[1] - q[1] + apart * torch.exp(-p[1]) - 1).sum(-1)
