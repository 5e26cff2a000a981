"""Which foot joints stand, frame by frame, in motion whose feet slide."""

from __future__ import annotations

import numpy as np

# Metres and metres per second of a body with legs of 0.85 m; what begins below the first goes on up to the second.
_LOW, _RISEN = 0.025, 0.045
_SLOW, _FAST = 0.25, 0.8
_SPAN = 0.05  # seconds on either side over which a speed is measured, so that noise is none
_SHORTEST = 0.1  # seconds: what stands less long needs no help


def speeds(points: np.ndarray, fps: float) -> np.ndarray:
    """(2, T, N) m/s over the ground of points (T, N, 3), before and after each frame."""
    frames, reach = len(points), max(1, round(_SPAN * fps))
    if frames < 2:
        return np.zeros((2, *points.shape[:2]))
    at = np.arange(frames)
    before, after = np.maximum(at - reach, 0), np.minimum(at + reach, frames - 1)
    ground = points[..., [0, 2]]
    earlier = np.linalg.norm(ground - ground[before], axis=-1) / np.maximum(at - before, 1)[:, None]
    later = np.linalg.norm(ground[after] - ground, axis=-1) / np.maximum(after - at, 1)[:, None]
    earlier[0], later[-1] = later[0], earlier[-1]
    return np.stack([earlier, later]) * fps


def heights(points: np.ndarray) -> np.ndarray:
    """(T, N) height in metres of points (T, N, 3) over their own standing height, the 5th percentile of each."""
    return points[..., 1] - np.percentile(points[..., 1], 5, axis=0)


def grip(points: np.ndarray, fps: float, scale: float, fast: float) -> np.ndarray:
    """(T, N) from 0 to 1, how likely the body stands on each point (T, N, 3): low, and slow against `fast` m/s."""
    low, slow = np.maximum(heights(points), 0) / (_RISEN * scale), speeds(points, fps).max(0) / (fast * scale)
    return np.exp(-np.square(low) * 2 - np.square(slow))


def stance_weights(points: np.ndarray, fps: float, scale: float) -> np.ndarray:
    """(T, N) from 0 to 1, how surely each point stands: low and slow, by two thresholds each, so that noise makes no
    borders. Points (T, N, 3) of one foot; 0 is in the air for certain."""
    low, slow = heights(points) / scale, speeds(points, fps).min(0) / scale  # the first and last frame stand too
    sure = np.minimum(_below(low, _LOW, _RISEN), _below(slow, _SLOW, _FAST))
    for n in range(points.shape[1]):
        for first, last in runs(sure[:, n] > 0):
            if last - first < _SHORTEST * fps or sure[first:last, n].max() < 1:
                sure[first:last, n] = 0
    return sure


def _below(values: np.ndarray, least: float, most: float) -> np.ndarray:
    """1 up to the least, 0 from the most on."""
    return np.clip((most - values) / (most - least), 0, 1)


def runs(mask: np.ndarray) -> list[tuple[int, int]]:
    """First frame and the one after the last of every run of True in a mask (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
