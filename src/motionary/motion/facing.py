"""Where a body faces, seen from above: headings about +y, 0 along +z, growing towards +x (the body's left)."""

from __future__ import annotations

import numpy as np

from motionary.motion.motion import Motion

_TINY = 1e-8


def heading(motion: Motion) -> np.ndarray:
    """(T,) radians: the heading at every frame, from hips and shoulders together.

    Frames without a facing (hips and shoulders coincident, or the body's side pointing straight up) take the last
    frame's that has one; a motion without any faces +z.
    """
    return headings(forward_vectors(motion.positions, motion.skeleton.hips, motion.skeleton.shoulders))


def forward_vectors(positions: np.ndarray, hips: tuple[int, int], shoulders: tuple[int, int]) -> np.ndarray:
    """(T, 2) horizontal (x, z) facing vectors y x across, where across is the unit vector from left to right.

    They are shorter than 1 where the body leans to its side, and 0 where across is. `hips` and `shoulders` are
    (left, right).
    """
    sides = positions.astype(np.float64)
    across = sides[:, hips[1]] - sides[:, hips[0]] + sides[:, shoulders[1]] - sides[:, shoulders[0]]
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    across = np.where(length > _TINY, across / np.maximum(length, _TINY), 0.0)
    return np.stack([across[:, 2], -across[:, 0]], axis=-1)


def headings(forward: np.ndarray) -> np.ndarray:
    """(T,) radians of (T, 2) facing vectors; vectors of no length take their neighbour's heading."""
    return np.arctan2(*fill_short(forward, np.array([0.0, 1.0])).T)


def fill_short(vectors: np.ndarray, default: np.ndarray, tiny: float = _TINY) -> np.ndarray:
    """Vectors (T, n), those of no length replaced by the last one that has a length (else the first, else default)."""
    valid = np.einsum("tn,tn->t", vectors, vectors) > tiny**2
    if valid.all():
        return vectors
    if not valid.any():
        return np.broadcast_to(default, vectors.shape).astype(vectors.dtype)
    last = np.maximum.accumulate(np.where(valid, np.arange(len(valid)), -1))
    return vectors[np.where(last < 0, np.argmax(valid), last)]


def rotate_y(positions: np.ndarray, angle: np.ndarray | float) -> np.ndarray:
    """Vectors (..., 3) turned about +y by angle radians (+z towards +x); angle broadcasts against (...)."""
    cosine, sine = np.cos(angle), np.sin(angle)
    turned = np.empty((*np.broadcast_shapes(positions.shape[:-1], np.shape(angle)), 3), positions.dtype)
    x, y, z = positions[..., 0], positions[..., 1], positions[..., 2]
    turned[..., 0] = cosine * x + sine * z
    turned[..., 1] = y
    turned[..., 2] = cosine * z - sine * x
    return turned


def wrap(angle: np.ndarray, period: float = 2 * np.pi) -> np.ndarray:
    """Angles brought into [-period / 2, period / 2)."""
    return (angle + period / 2) % period - period / 2
