"""The nearest of many vectors."""

from __future__ import annotations

import numpy as np


def nearest(queries: np.ndarray, candidates: np.ndarray, k: int = 1) -> np.ndarray:
    """(Q, k) rows of `candidates` (N, E) by Euclidean distance from `queries` (Q, E), nearest first; k is at most N."""
    squared = (queries**2).sum(1)[:, None] + (candidates**2).sum(1)[None] - 2 * queries @ candidates.T
    return np.argsort(squared, axis=1, kind="stable")[:, :k]
