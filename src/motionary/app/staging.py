"""Where motions stand, what the view follows, and from where it sees all of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from motionary.motion import Motion

_GAP = 0.5  # metres at least between neighbours, at every moment
_RATE = 10.0  # moments per second at which they are compared
_CALM = 0.8  # seconds over which what is followed is averaged
_SEEN_FROM = np.array([0.35, 0.28, 1.0]) / np.linalg.norm([0.35, 0.28, 1.0])
_MARGIN = 0.85  # of the view that is filled
_SHEET = 576  # pixels; on narrower pages viser's controls cover the lower part
_FREE = 0.42  # of the height that they leave


def places(motions: Sequence[Motion]) -> list[np.ndarray]:
    """How far to move each motion (3,) so that it starts beside the others, on the floor, and never comes near them.

    From left to right; a neighbour on the right stays on the right at every moment of the common clock.
    """
    found, edges = [], None
    moments = np.arange(0, max((motion.duration for motion in motions), default=0.0) + 1 / _RATE, 1 / _RATE)
    for motion in motions:
        frames = np.minimum((moments * motion.fps).astype(int), motion.frames - 1)
        start = motion.positions[0, 0]
        across = motion.positions[frames, :, 0] - start[0]
        low, high = across.min(1), across.max(1)
        x = 0.0 if edges is None else float((edges - low).max()) + _GAP
        found.append(np.array([x, -motion.positions[..., 1].min(), -start[2]], np.float64))
        found[-1][0] -= start[0]
        edges = high + x
    return found


def way_of(motion: Motion, shift: np.ndarray) -> np.ndarray:
    """(T, 3) the root's way over the floor at y = 0, without its sway, moved by `shift` (3,)."""
    return smoothed((motion.positions[:, 0].astype(np.float64) + shift) * [1, 0, 1], motion.fps)


def smoothed(values: np.ndarray, fps: float) -> np.ndarray:
    """The mean of (T, D) values around each frame; the first and the last value are repeated beyond the ends."""
    half = min(int(_CALM * fps / 2), len(values) - 1)
    padded = np.concatenate([np.repeat(values[:1], half, 0), values, np.repeat(values[-1:], half, 0)])
    sums = np.concatenate([np.zeros((1, values.shape[1])), padded.cumsum(0, dtype=np.float64)])
    return (sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1)


def viewpoint(points: np.ndarray, fov: float, width: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) and target (3,) of a camera that has all points in view and no more than that.

    Args:
        points: (N, 3) metres.
        fov: vertical, in radians.
        width, height: of the picture, in pixels.
    """
    right = np.cross([0.0, 1.0, 0.0], _SEEN_FROM)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(_SEEN_FROM, right), _SEEN_FROM])
    middle = (points.min(0) + points.max(0)) / 2
    x, y, z = axes @ (points - middle).T
    tall = np.tan(fov / 2)
    wide = tall * width / max(height, 1.0)
    free = _FREE if width < _SHEET else 1.0
    lift = 1 - free  # the middle of what is free, in half heights above the picture's
    # |x| <= wide (away - z) and |y + lift tall away - lift tall (away - z)| <= free tall (away - z), solved for away
    across, up = np.abs(x) / (wide * _MARGIN), np.abs(y + lift * tall * z) / (tall * free * _MARGIN)
    away = float((np.maximum(across, up) + z).max())
    target = middle - lift * tall * away * axes[1]
    return target + away * _SEEN_FROM, target
