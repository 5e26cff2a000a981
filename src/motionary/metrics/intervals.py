"""Intervals of repeated measurements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.metrics.inputs import matrix, same_shape


@dataclass(frozen=True)
class Interval:
    """A mean with the half width of its 95% interval (NaN where one value alone gives none)."""

    mean: float
    half: float

    @property
    def low(self) -> float:
        """Lower end."""
        return self.mean - self.half

    @property
    def high(self) -> float:
        """Upper end."""
        return self.mean + self.half

    def report(self) -> dict[str, float]:
        """As reports hold it: {"mean", "half"}, the half 0 where one value alone gave none."""
        return {"mean": round(self.mean, 6), "half": round(0.0 if np.isnan(self.half) else self.half, 6)}

    def __str__(self) -> str:
        return f"{self.mean:.3f} ± {self.half:.3f}"


def interval(values: Any) -> Interval:
    """Mean and 1.96 sigma / sqrt(n) over repetitions, sigma the population's, as in the released evaluation.

    Args:
        values: (n,) one value per repetition, n >= 1.
    """
    values = matrix("values", values, 1).astype(np.float64)
    return Interval(float(values.mean()), float(1.96 * values.std() / np.sqrt(len(values))))


def paired_interval(a: Any, b: Any) -> Interval:
    """Mean of a - b and its 95% interval by Student's t over pairs, for few seeds.

    Args:
        a: (n,) one value per seed.
        b: (n,) values of the other system with the same seeds.
    """
    from scipy.special import stdtrit  # late: with scipy, `import motionary` would take longer; the quantile of t

    a, b = matrix("a", a, 1), matrix("b", b, 1)
    same_shape("a, b", a, b)
    difference = a.astype(np.float64) - b
    n = len(difference)
    if n < 2:
        return Interval(float(difference.mean()), float("nan"))
    return Interval(float(difference.mean()), float(stdtrit(n - 1, 0.975) * difference.std(ddof=1) / np.sqrt(n)))


def paired_bootstrap(
    a: Any, b: Any, draws: int = 10_000, generator: np.random.Generator | None = None
) -> tuple[float, float, float]:
    """Mean of a - b with the 2.5% and 97.5% percentiles of its bootstrap over paired items.

    Args:
        a: (n,) one score per item (clip or caption).
        b: (n,) scores of the other system for the same items.
        draws: resamples.
        generator: draws them; seed 0 where None.

    Returns:
        mean, low, high.
    """
    a, b = matrix("a", a, 1), matrix("b", b, 1)
    same_shape("a, b", a, b)
    if draws < 1:
        raise InputError("draws", draws, "must be at least 1")
    generator = generator or np.random.default_rng(0)
    difference = a.astype(np.float64) - b
    n = len(difference)
    # In slices, so that memory does not grow with draws x n.
    step = max(1, 1_000_000 // n)
    means = [
        difference[generator.integers(n, size=(min(step, draws - start), n))].mean(1) for start in range(0, draws, step)
    ]
    low, high = np.percentile(np.concatenate(means), (2.5, 97.5))
    return float(difference.mean()), float(low), float(high)
