"""Independent normal distributions, what variational systems draw their latents from."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from motionary.nn.precision import widened

# Logarithms of variances beyond these only come of a training gone wrong, and their exponentials would not be finite.
LEAST_LOG_VARIANCE, MOST_LOG_VARIANCE = -12.0, 6.0


class Gaussian(NamedTuple):
    """Independent normal distributions: mean and logarithm of the variance, (..., z) each."""

    mean: Tensor
    log_variance: Tensor

    def sample(self, noise: Tensor) -> Tensor:
        """A draw, from standard normal noise of the same shape."""
        return self.mean + noise * torch.exp(0.5 * self.log_variance)


def divergence(q: Gaussian, p: Gaussian) -> Tensor:
    """KL(q || p) (...,) in nats, summed over the last dimension: the closed form, of the third term of the thesis's
    Eq. 4.6 and of each term of TEMOS Eq. 2."""
    distance = (q.mean - p.mean).square() + q.log_variance.exp()
    return 0.5 * (p.log_variance - q.log_variance + distance * torch.exp(-p.log_variance) - 1).sum(-1)


def gaussian(parameters: Tensor) -> Gaussian:
    """Means and logarithms of variances (..., 2z) as distributions of 32 bits; the logarithms are kept in a finite
    range."""
    mean, log_variance = widened(parameters).chunk(2, dim=-1)
    return Gaussian(mean, log_variance.clamp(LEAST_LOG_VARIANCE, MOST_LOG_VARIANCE))
