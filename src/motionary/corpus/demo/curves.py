"""Smooth curves over time and small rotation matrices: the arithmetic under the motion grammar.

Everything here is vectorized over frames. Curves are planned at RATE frames per second and sampled later.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from motionary.motion.rotations import euler_to_rotmat

RATE = 60.0  # frames per second at which motions are planned, whatever the rate of the finished clip


def frames_of(seconds: float) -> int:
    """Number of planning frames that cover `seconds` with both ends included."""
    return round(seconds * RATE) + 1


def times_of(seconds: float) -> np.ndarray:
    """Planning times (N,) in seconds from 0 to about `seconds`."""
    return np.arange(frames_of(seconds)) / RATE


def _monotone_slopes(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Slopes without overshoot: zero at ends and extremes, weighted harmonic means between (Fritsch & Butland 1984)."""
    slopes = np.zeros_like(values)
    if len(times) < 3:
        return slopes
    step = np.diff(times)[:, None]
    rise = np.diff(values, axis=0) / step
    before, after = rise[:-1], rise[1:]
    w1, w2 = 2 * step[1:] + step[:-1], step[1:] + 2 * step[:-1]
    same = before * after > 0
    safe_before, safe_after = np.where(same, before, 1.0), np.where(same, after, 1.0)
    slopes[1:-1] = np.where(same, (w1 + w2) / (w1 / safe_before + w2 / safe_after), 0.0)
    return slopes


def curve(t: np.ndarray, times: Sequence[float] | np.ndarray, values, slopes=None) -> np.ndarray:
    """Piecewise cubic through keyframes, held constant outside them.

    Args:
        t: (N,) seconds.
        times: K increasing seconds.
        values: (K,) or (K, D) keyframes.
        slopes: like values, in units per second; by default smooth and without overshoot.

    Returns:
        (N,) or (N, D).
    """
    knots = np.asarray(times, dtype=np.float64)
    keys = np.asarray(values, dtype=np.float64)
    flat = keys.reshape(len(knots), -1)
    tangents = _monotone_slopes(knots, flat) if slopes is None else np.asarray(slopes, np.float64).reshape(flat.shape)
    inside = np.clip(t, knots[0], knots[-1])
    index = np.clip(np.searchsorted(knots, inside, side="right") - 1, 0, len(knots) - 2)
    step = (knots[index + 1] - knots[index])[:, None]
    s = (inside - knots[index])[:, None] / step
    result = (
        (1 + 2 * s) * (1 - s) ** 2 * flat[index]
        + s * (1 - s) ** 2 * step * tangents[index]
        + s * s * (3 - 2 * s) * flat[index + 1]
        + s * s * (s - 1) * step * tangents[index + 1]
    )
    return result.reshape((len(t), *keys.shape[1:]))


def ease(s: np.ndarray) -> np.ndarray:
    """Quintic step from 0 to 1: no velocity and no acceleration at either end."""
    s = np.clip(s, 0.0, 1.0)
    return s * s * s * (10 + s * (6 * s - 15))


def smooth(x: np.ndarray, seconds: float) -> np.ndarray:
    """Two moving averages of `seconds` each along the first axis, ends held."""
    width = max(1, round(seconds * RATE)) | 1
    if width == 1:
        return x
    flat = x.reshape(len(x), -1)
    for _ in range(2):
        padded = np.pad(flat, ((width // 2 + 1, width // 2), (0, 0)), mode="edge")
        total = np.cumsum(padded, axis=0)
        flat = (total[width:] - total[:-width]) / width
    return flat.reshape(x.shape)


def dilate(x: np.ndarray, seconds: float) -> np.ndarray:
    """Maximum over a centered window of `seconds` along the first axis of (N,)."""
    half = max(1, round(seconds * RATE / 2))
    padded = np.pad(x, half, mode="edge")
    return np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1).max(axis=-1)


def wander(rng: np.random.Generator, t: np.ndarray, channels: int) -> np.ndarray:
    """Slow, bounded unrest (N, channels) of about unit size: three sines of 0.15-0.7 Hz each."""
    frequency = rng.uniform(0.15, 0.7, (3, 1, channels))
    phase = rng.uniform(0, 2 * np.pi, (3, 1, channels))
    return np.sin(2 * np.pi * frequency * t[None, :, None] + phase).sum(axis=0) * 0.6


def rotate_x(angle: np.ndarray) -> np.ndarray:
    """(...,) radians -> (..., 3, 3); positive leans y towards z (forward)."""
    return euler_to_rotmat(0, angle)


def rotate_y(angle: np.ndarray) -> np.ndarray:
    """(...,) radians -> (..., 3, 3); positive turns z towards x (to the left)."""
    return euler_to_rotmat(1, angle)


def rotate_z(angle: np.ndarray) -> np.ndarray:
    """(...,) radians -> (..., 3, 3); positive turns x towards y."""
    return euler_to_rotmat(2, angle)
