"""Windows that show nearly the same motion: by their joints, or by where models put them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from tqdm import tqdm

SAME_JOINTS = 0.03  # m, root mean square over joints and instants of two outlines
SAME_PLACE = 0.05  # of the usual distance between two windows in the models' space
_MOST = 5  # others that one window is listed with
_ROWS = 1024
_LENGTH = 1.1  # of two windows, the longer by the shorter


@dataclass(frozen=True)
class Pair:
    """Two windows by row: the distance of their joints (m), and that in the models' space in units of the usual one."""

    first: int
    second: int
    joints: float
    embedding: float


def near_duplicates(
    outlines: np.ndarray, embeddings: np.ndarray, clips: np.ndarray, seconds: np.ndarray, progress: bool = False
) -> list[Pair]:
    """Pairs of windows of different clips whose joints, or embeddings, nearly agree; of each window the nearest few.

    Args:
        outlines: (W, 16, J, 3) of :class:`motionary.archive.moments.Cut`.
        embeddings: (W, E).
        clips: (W,) the clip that each window is of.
        seconds: (W,) their lengths; windows of other lengths are not compared.
        progress: show a bar.
    """
    if len(outlines) < 2:
        return []
    shapes = outlines.reshape(len(outlines), -1).astype(np.float32)
    points = shapes.shape[1] / 3
    places = np.ascontiguousarray(embeddings, np.float32) / max(_usual(embeddings), 1e-9)
    found = []
    for first in tqdm(range(0, len(shapes), _ROWS), "duplicates", unit="part", disable=not progress):
        rows = np.arange(first, min(first + _ROWS, len(shapes)))
        joints = np.sqrt(_squares(shapes, rows) / points)
        away = np.sqrt(_squares(places, rows))
        ratio = seconds[rows, None] / seconds[None, first:]
        apart = (clips[rows, None] == clips[None, first:]) | (ratio > _LENGTH) | (ratio < 1 / _LENGTH)
        apart |= rows[:, None] >= np.arange(first, len(shapes))
        same = ((joints < SAME_JOINTS) | (away < SAME_PLACE)) & ~apart
        found += list(_nearest(rows, first, same, joints, away))
    return found


def _squares(points: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """(R, W - first) squared distances of some rows to those from the first of them on."""
    own, others = points[rows], points[rows[0] :]
    return np.maximum((own**2).sum(1)[:, None] + (others**2).sum(1) - 2 * own @ others.T, 0)


def _nearest(rows: np.ndarray, first: int, same: np.ndarray, joints: np.ndarray, away: np.ndarray) -> Iterator[Pair]:
    for row in np.flatnonzero(same.any(axis=1)):
        others = np.flatnonzero(same[row])
        for other in others[np.argsort(joints[row, others], kind="stable")[:_MOST]]:
            yield Pair(int(rows[row]), first + int(other), float(joints[row, other]), float(away[row, other]))


def _usual(embeddings: np.ndarray) -> float:
    """The median distance of a thousand pairs drawn by chance."""
    pairs = np.random.default_rng(0).integers(len(embeddings), size=(1000, 2))
    return float(np.median(np.linalg.norm(embeddings[pairs[:, 0]] - embeddings[pairs[:, 1]], axis=-1)))
