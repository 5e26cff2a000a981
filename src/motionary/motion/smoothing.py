"""The smoothest curve near some values: corrections that begin and end without a pop."""

from __future__ import annotations

import numpy as np


def smoothest(values: np.ndarray, weights: np.ndarray, stiffness: float) -> np.ndarray:
    """(T, K) x that minimizes sum_t w_t |x_t - values_t|^2 + stiffness sum_t |x_t-1 - 2 x_t + x_t+1|^2.

    (Whittaker, "On a new method of graduation", 1923.) A frame of weight 0 is free; some two frames need a weight.

    Args:
        values: (T, K).
        weights: (T,) at least 0.
        stiffness: frames^4; the curve follows over about stiffness^(1/4) frames.
    """
    rows = _bands(np.asarray(weights, np.float64), stiffness)
    right = np.asarray(values, np.float64) * np.asarray(weights, np.float64)[:, None]
    return np.stack([_solve(rows, column) for column in right.T.tolist()], axis=-1)


def _bands(weights: np.ndarray, stiffness: float) -> list[tuple[float, float, float]]:
    """L D L^T of the system, which has two bands beside its diagonal: (d_t, l_t,t-1, l_t,t-2) of each row."""
    frames = len(weights)
    second = np.zeros((frames + 4, 3))  # rows of the second difference; those that leave the motion are zero
    second[2:frames] = 1, -2, 1  # row t: x_t-2, x_t-1, x_t
    main = weights + stiffness * (
        second[:frames, 2] ** 2 + second[1 : frames + 1, 1] ** 2 + second[2 : frames + 2, 0] ** 2
    )
    first = stiffness * (
        second[:frames, 1] * second[:frames, 2] + second[1 : frames + 1, 0] * second[1 : frames + 1, 1]
    )
    outer = stiffness * second[:frames, 0] * second[:frames, 2]
    rows: list[tuple[float, float, float]] = []
    d1 = d2 = l1 = 0.0  # of the rows before
    for a, b, c in zip(main.tolist(), first.tolist(), outer.tolist(), strict=True):
        far = c / d2 if d2 else 0.0
        near = (b - far * d2 * l1) / d1 if d1 else 0.0
        d = a - near * near * d1 - far * far * d2
        rows.append((d, near, far))
        d1, d2, l1 = d, d1, near
    return rows


def _solve(rows: list[tuple[float, float, float]], column: list[float]) -> np.ndarray:
    """Forward and back through L D L^T."""
    found = list(column)
    for t, (_, near, far) in enumerate(rows):
        found[t] -= (near * found[t - 1] if t else 0.0) + (far * found[t - 2] if t > 1 else 0.0)
    found = [value / d for value, (d, _, _) in zip(found, rows, strict=True)]
    for t in range(len(rows) - 2, -1, -1):
        found[t] -= rows[t + 1][1] * found[t + 1]
        if t + 2 < len(rows):
            found[t] -= rows[t + 2][2] * found[t + 2]
    return np.array(found)
