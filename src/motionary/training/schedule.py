"""The learning rate of every step, and how it grows with the number of processes."""

from __future__ import annotations

import math

from motionary.training.settings import TrainSettings


def rate(settings: TrainSettings, step: int) -> float:
    """Factor on the peak learning rate at `step`: linear warm-up, then constant or cosine to a hundredth."""
    if step < settings.warmup_steps:
        return (step + 1) / settings.warmup_steps
    if settings.schedule == "constant":
        return 1.0
    done = (step - settings.warmup_steps) / max(1, settings.steps - settings.warmup_steps)
    return 0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * min(1.0, done)))


def peak_factor(settings: TrainSettings, world: int) -> float:
    """Factor on the configured rate for `world` processes, whose batches together are as many times larger.

    "linear" multiplies by their number (Goyal et al., 2017, for SGD), "sqrt" by its root (Krizhevsky, 2014; Malladi et
    al., 2022, for Adam), "none" leaves the rate alone.
    """
    return {"none": 1.0, "sqrt": math.sqrt(world), "linear": float(world)}[settings.scale_rate]
