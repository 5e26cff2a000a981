"""Motion along a line over the ground."""

from __future__ import annotations

from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.motion.facing import wrap
from motionary.motion.motion import Motion
from motionary.motion.pinning import bent, on_body
from motionary.motion.planting import replant_feet
from motionary.motion.smoothing import smoothest

FASTEST = 8.0  # m/s that a person runs
_FARTHEST = 1e6  # metres
_SPACING = 0.05  # metres between the points of a smoothed path
_ROUND = 0.25  # metres over which its corners are rounded
_SWAY = 0.5  # seconds: what is slower is the way that the body goes, what is faster its sway


def checked_path(points: Any, seconds: float) -> np.ndarray:
    """(N, 2) x and z in metres of a ground path that can be gone in so many seconds.

    Raises:
        InputError: no line of finite points, without length, or faster than a person runs.
    """
    try:
        path = np.asarray(points, np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError("path", points, "must be points (x, z) in metres") from None
    if path.ndim != 2 or path.shape[1] not in (2, 3) or len(path) < 2 or not np.isfinite(path).all():
        raise InputError("path", path.shape, "must be at least two finite points (x, z), or (x, y, z), in metres")
    path = path if path.shape[1] == 2 else path[:, [0, 2]]
    length = length_of(path)
    if length < _SPACING:
        raise InputError("path", f"{length:.3f} m", f"must be at least {_SPACING:g} m long")
    if length > FASTEST * seconds:
        rule = f"in {seconds:.1f} s a person runs at most {FASTEST * seconds:.1f} m ({FASTEST:g} m/s)"
        raise InputError("path", f"{length:.1f} m", rule)
    return path


def read_points(text: str) -> list[list[float]]:
    """The points of a path as people type them: "x,z x,z", in metres; InputError where one is no number."""
    try:
        points = [[float(number) for number in pair.split(",")] for pair in text.split()]
    except ValueError:
        raise InputError("path", text, "must be points x,z between blanks, in metres") from None
    if any(abs(number) > _FARTHEST for point in points for number in point):
        raise InputError("path", text, f"no point may be farther than {_FARTHEST:g} m away")
    return points


def length_of(path: np.ndarray) -> float:
    """Metres of a line (N, 2)."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=-1).sum())


def along(motion: Motion, path: np.ndarray, feet: bool = True) -> Motion:
    """The motion led along a path (N, 2) of x and z, from its first point to its last.

    It goes at the pace that it has, slower or faster as a whole, turns with the path as it turned with its own way, and
    sways about it as it did.
    """
    motion = on_body(motion)
    roots = motion.positions[:, 0].astype(np.float64)[:, [0, 2]]
    own = smoothest(roots, np.ones(len(roots)), (_SWAY * motion.fps / 2) ** 4)
    gone = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(own, axis=0), axis=-1))])
    share = gone / gone[-1] if gone[-1] > _SPACING else np.linspace(0, 1, len(gone))
    line = _rounded(path)
    at = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=-1))])
    way = np.stack([np.interp(share * at[-1], at, line[:, k]) for k in (0, 1)], axis=-1)
    yaw = _calm(_bearings(line, np.interp(share * at[-1], at, np.arange(len(at)))) - _heading_of(own), motion.fps)
    turned = bent(motion, yaw, np.zeros((motion.frames, 3)))
    sway = roots - own
    cosine, sine = np.cos(yaw), np.sin(yaw)
    sway = np.stack([cosine * sway[:, 0] + sine * sway[:, 1], cosine * sway[:, 1] - sine * sway[:, 0]], axis=-1)
    off = way + sway - turned.positions[:, 0][:, [0, 2]]
    led = bent(turned, np.zeros(motion.frames), np.insert(off, 1, 0, axis=1))
    return replant_feet(led, np.zeros(led.frames, bool)) if feet else led


def _rounded(path: np.ndarray) -> np.ndarray:
    """The path with points evenly spaced and rounded corners, its ends kept."""
    at = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=-1))])
    places = np.linspace(0, at[-1], max(8, round(at[-1] / _SPACING) + 1))
    even = np.stack([np.interp(places, at, path[:, k]) for k in (0, 1)], axis=-1)
    weights = np.ones(len(even))
    weights[[0, -1]] = 1e6
    return smoothest(even, weights, (_ROUND / _SPACING / 2) ** 4)


def _bearings(line: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(T,) radians in which a line (N, 2) goes at places (T,), counted in its points."""
    steps = np.gradient(line, axis=0)
    bearing = np.unwrap(np.arctan2(steps[:, 0], steps[:, 1]))
    return np.interp(places, np.arange(len(line)), bearing)


def _heading_of(way: np.ndarray) -> np.ndarray:
    """(T,) radians in which a way (T, 2) goes; where it rests, as where it went last or will go first."""
    steps = np.gradient(way, axis=0) if len(way) > 1 else np.zeros((1, 2))
    speed = np.linalg.norm(steps, axis=-1)
    goes = speed > max(0.2 * speed.max(), 1e-4)
    if not goes.any():
        return np.zeros(len(way))
    bearing = np.unwrap(np.arctan2(steps[goes, 0], steps[goes, 1]))
    return np.interp(np.arange(len(way)), np.flatnonzero(goes), bearing)


def _calm(yaw: np.ndarray, fps: float) -> np.ndarray:
    """The turning without its quick parts, which are the steps' own."""
    yaw = yaw - (yaw[0] - float(wrap(yaw[:1])[0]))
    return smoothest(yaw[:, None], np.ones(len(yaw)), (_SWAY * fps / 2) ** 4)[:, 0]
