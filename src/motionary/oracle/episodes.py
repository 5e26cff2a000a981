"""Counting how often a curve goes up and comes back."""

from __future__ import annotations

import numpy as np


def spans(x: np.ndarray, high: float, low: float) -> np.ndarray:
    """(K, 2) first and last frame of each stay of x (T,) above `high`, until it falls below `low`."""
    marks = np.flatnonzero((x > high) | (x < low))
    up = x[marks] > high
    if not up.any():
        return np.zeros((0, 2), int)
    begins = up & np.concatenate([[True], ~up[:-1]])
    ends = up & np.concatenate([~up[1:], [True]])
    return np.stack([marks[begins], marks[ends]], 1)


def episodes(x: np.ndarray, high: float, low: float) -> int:
    """Number of stays of x (T,) above `high`, counted as in :func:`spans`."""
    return len(spans(x, high, low))


def reversals(x: np.ndarray, amplitude: float) -> int:
    """How often x (T,), centered, changes between more than +amplitude and less than -amplitude."""
    marks = x[np.abs(x) > amplitude] > 0
    return int((marks[1:] != marks[:-1]).sum())
