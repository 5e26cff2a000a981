"""Noise that depends on the seed of its row alone, so that no result depends on the others of a call."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch


def uniform_noise(seeds: Sequence[int], steps: int) -> torch.Tensor:
    """(B, steps) float64 in [0, 1), row i from seeds[i] alone; a longer draw starts with the shorter one."""
    rows = [np.random.default_rng(int(seed)).random(steps) for seed in seeds]
    return torch.from_numpy(np.stack(rows)) if rows else torch.zeros(0, steps, dtype=torch.float64)


def normal_noise(seeds: Sequence[int], steps: int, dim: int) -> torch.Tensor:
    """(B, steps, dim) float32 standard normal, row i from seeds[i] alone; a longer draw starts with the shorter one."""
    rows = [np.random.default_rng(int(seed)).standard_normal((steps, dim), dtype=np.float32) for seed in seeds]
    return torch.from_numpy(np.stack(rows))
