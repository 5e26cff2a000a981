"""Normal distributions: draws and divergence against torch's own, and 32 bits whatever they are made of."""

from __future__ import annotations

import torch
from torch.distributions import Normal, kl_divergence

from motionary.nn.gaussian import Gaussian, divergence, gaussian


def test_the_divergence_is_that_of_torch():
    a, b, c, d = torch.randn(4, 6, 5, generator=torch.Generator().manual_seed(0))
    expected = kl_divergence(Normal(a, (0.5 * b).exp()), Normal(c, (0.5 * d).exp())).sum(-1)
    assert torch.allclose(divergence(Gaussian(a, b), Gaussian(c, d)), expected, atol=1e-4)
    assert torch.allclose(Gaussian(a, b).sample(torch.ones_like(a)), a + b.exp().sqrt(), atol=1e-5)


def test_parameters_become_finite_distributions_of_32_bits():
    made = gaussian(torch.tensor([[1.0, -2.0, 100.0, -100.0]], dtype=torch.bfloat16))
    assert made.mean.dtype == made.log_variance.dtype == torch.float32
    assert made.mean.tolist() == [[1, -2]]
    assert bool(divergence(made, Gaussian(torch.zeros(1, 2), torch.zeros(1, 2))).isfinite().all())
