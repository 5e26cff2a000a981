"""Smooth curves over time and small rotation matrices: the arithmetic under the motion grammar.

Everything here is vectorized over frames. Curves are planned at RATE frames per second and sampled later.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

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


def _planar(angle: np.ndarray, i: int, j: int) -> np.ndarray:
    angle = np.asarray(angle, dtype=np.float64)
    result = np.zeros((*angle.shape, 3, 3))
    cosine, sine = np.cos(angle), np.sin(angle)
    result[..., 3 - i - j, 3 - i - j] = 1.0
    result[..., i, i] = result[..., j, j] = cosine
    result[..., i, j], result[..., j, i] = -sine, sine
    return result


def rotate_x(angle: np.ndarray) -> np.ndarray:
    """(...,) radians -> (..., 3, 3); positive leans y towards z (forward)."""
    return _planar(angle, 1, 2)


def rotate_y(angle: np.ndarray) -> np.ndarray:
    """(...,) radians -> (..., 3, 3); positive turns z towards x (to the left)."""
    return _planar(angle, 2, 0)


def rotate_z(angle: np.ndarray) -> np.ndarray:
    """(...,) radians -> (..., 3, 3); positive turns x towards y."""
    return _planar(angle, 0, 1)


def swing_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Shortest rotation (..., 3, 3) taking unit vectors a to unit vectors b, not exactly opposite (Rodrigues)."""
    v = np.cross(a, b)
    cosine = np.sum(np.broadcast_to(a, v.shape) * b, axis=-1)[..., None, None]
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    zero = np.zeros_like(x)
    skew = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*x.shape, 3, 3)
    return np.eye(3) + skew + skew @ skew / np.maximum(1 + cosine, 1e-6)


def to_quaternions(matrices: np.ndarray) -> np.ndarray:
    """(T, J, 3, 3) rotation matrices -> (T, J, 4) unit quaternions xyzw without sign flips over time.

    The largest of the four components is found first, then the others from it (Shepperd 1978).
    """
    m = matrices
    m00, m11, m22 = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    squares = np.stack([1 + m00 - m11 - m22, 1 - m00 + m11 - m22, 1 - m00 - m11 + m22, 1 + m00 + m11 + m22], -1)
    xy, xz, yz = m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]
    wx, wy, wz = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    rows = np.stack([squares[..., 0], xy, xz, wx, xy, squares[..., 1], yz, wy], -1)
    rows = np.concatenate([rows, np.stack([xz, yz, squares[..., 2], wz, wx, wy, wz, squares[..., 3]], -1)], -1)
    rows = rows.reshape(*squares.shape, 4)
    best = np.argmax(squares, axis=-1)[..., None, None]
    q = np.take_along_axis(rows, best, axis=-2)[..., 0, :]
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    flips = np.sum(q[1:] * q[:-1], axis=-1) < 0
    signs = np.where(np.cumsum(flips, axis=0) % 2, -1.0, 1.0)
    q[1:] *= signs[..., None]
    return q
