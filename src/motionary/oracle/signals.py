"""What the oracle looks at: a few curves over time, of any skeleton, in the body's own units and frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from motionary.errors import InputError
from motionary.metrics.position import across

if TYPE_CHECKING:
    from motionary.motion import Motion

_ROLES = tuple(f"{side}_{joint}" for joint in ("ankle", "knee", "wrist", "elbow") for side in ("left", "right"))


@dataclass(frozen=True, eq=False)
class Signals:
    """Curves over T frames; sides are indexed 0 = left, 1 = right; lengths in units of the leg or arm.

    Attributes:
        fps: frames per second.
        leg: length of a leg from hip to ankle, m.
        path: (T, 2) root on the ground (x, z), sway of the steps smoothed away, m.
        heading: (T,) unwrapped, degrees, growing when the body turns left.
        velocity: (T, 2) of `path` towards (left, forward) of the body, m/s.
        wrist: (T, 2, 3) wrists from their own shoulders (left, up, forward), arm lengths.
        over_head: (T, 2) wrists above the head, m.
        over_floor: (T, 2) wrists above the floor, leg lengths.
        shake: (2,) noise of the wrists from frame to frame (standard deviation per axis), arm lengths.
        hands: (T,) distance of the wrists, arm lengths.
        foot: (T, 2, 3) ankles from the hips' middle (left, up, forward), leg lengths.
        knee: (T, 2) knees above the hips' middle (negative below), leg lengths.
        lift: (T, 2) height of each foot (its lower joint) over the floor, leg lengths.
        rise: (T,) height of the hips over the floor, leg lengths (about 1.1 when standing).
        lean: (T, 2) inclination of the trunk to the (left, front), degrees.
    """

    fps: float
    leg: float
    path: np.ndarray
    heading: np.ndarray
    velocity: np.ndarray
    wrist: np.ndarray
    shake: np.ndarray
    over_head: np.ndarray
    over_floor: np.ndarray
    hands: np.ndarray
    foot: np.ndarray
    knee: np.ndarray
    lift: np.ndarray
    rise: np.ndarray
    lean: np.ndarray


def signals(motion: Motion) -> Signals:
    """Curves of a motion of any skeleton whose limbs are known.

    Raises:
        InputError: the skeleton lacks a limb.
    """
    skeleton, roles = motion.skeleton, motion.skeleton.roles
    missing = [role for role in _ROLES if role not in roles]
    if missing:
        raise InputError("skeleton", skeleton.name, f"the oracle needs the joints {', '.join(missing)}")
    raw = motion.positions.astype(np.float64)
    p = smooth(raw, 0.15 * motion.fps)
    pair = lambda joint: p[:, [roles[f"left_{joint}"], roles[f"right_{joint}"]]]  # noqa: E731 (T, 2, 3)
    hip, shoulder = p[:, list(skeleton.hips)], p[:, list(skeleton.shoulders)]
    ankle, knee, wrist, elbow = pair("ankle"), pair("knee"), pair("wrist"), pair("elbow")
    leg = _length(hip - knee) + _length(knee - ankle)
    arm = _length(shoulder - elbow) + _length(elbow - wrist)
    side = across(p, skeleton.hips, skeleton.shoulders)
    root, chest = hip.mean(1), shoulder.mean(1)
    head = p[:, roles["head"], 1] if "head" in roles else chest[:, 1] + 0.4 * arm
    path = smooth(root[:, [0, 2]], 0.6 * motion.fps)
    feet = p[:, list(skeleton.feet), 1].reshape(-1, 2, 2).min(-1)
    floor = share(feet.min(1), 0.05)
    trunk = _body((chest - root)[:, None], side)[:, 0]
    return Signals(
        fps=motion.fps,
        leg=leg,
        path=path,
        heading=np.degrees(np.unwrap(np.arctan2(-side[:, 1], side[:, 0]))),
        velocity=_body(_rate(path, motion.fps)[:, None], side)[:, 0],
        wrist=_body(wrist - shoulder, side) / arm,
        shake=_shake(raw[:, [roles["left_wrist"], roles["right_wrist"]]]) / arm,
        over_head=wrist[..., 1] - head[:, None],
        over_floor=(wrist[..., 1] - floor) / leg,
        hands=np.sqrt(np.square(wrist[:, 0] - wrist[:, 1]).sum(-1)) / arm,
        foot=_body(ankle - root[:, None], side) / leg,
        knee=(knee[..., 1] - root[:, None, 1]) / leg,
        lift=(feet - floor) / leg,
        rise=(root[:, 1] - floor) / leg,
        lean=np.degrees(np.arctan2(trunk[:, [0, 2]], trunk[:, 1:2])),
    )


def smooth(x: np.ndarray, frames: float) -> np.ndarray:
    """Mean over a centered window of about so many frames (an odd number), ends repeated; (T, ...) along time."""
    half = min(round((frames - 1) / 2), len(x) - 1)
    if half < 1:
        return x
    padded = np.concatenate([np.repeat(x[:1], half, axis=0), x, np.repeat(x[-1:], half, axis=0)])
    total = padded.cumsum(axis=0)
    total[2 * half + 1 :] -= total[: -2 * half - 1].copy()
    return total[2 * half :] / (2 * half + 1)


def share(x: np.ndarray, part: float) -> np.ndarray:
    """The value below which so large a share of the frames (first axis) lies; cheaper than a percentile."""
    k = min(int(part * len(x)), len(x) - 1)
    return np.partition(x, k, axis=0)[k]


def _rate(x: np.ndarray, fps: float) -> np.ndarray:
    """Central differences (T, ...) per second."""
    if len(x) < 2:
        return np.zeros_like(x)
    inner = (x[2:] - x[:-2]) / 2
    return np.concatenate([x[1:2] - x[:1], inner, x[-1:] - x[-2:-1]]) * fps


def _shake(x: np.ndarray) -> np.ndarray:
    """(K,) standard deviation of white noise in (T, K, 3) tracks, from second differences."""
    if len(x) < 3:
        return np.zeros(x.shape[1])
    second = x[2:] - 2 * x[1:-1] + x[:-2]
    # Second differences of white noise have 6 times its variance; 1.6 is the mean norm of three unit normals.
    return np.sqrt(np.square(second).sum(-1)).mean(0) / (1.6 * np.sqrt(6))


def _length(bones: np.ndarray) -> float:
    """Median length over time and sides, m; never zero."""
    return max(float(share(np.sqrt(np.square(bones).sum(-1)).ravel(), 0.5)), 1e-3)


def _body(v: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Vectors (T, K, 3), or (T, K, 2) on the ground, as (left, up, forward) or (left, forward) of the body."""
    x, z = side[:, None, 0], side[:, None, 1]
    turned = np.empty_like(v)
    turned[..., 0] = v[..., 0] * x + v[..., -1] * z
    turned[..., -1] = v[..., -1] * x - v[..., 0] * z
    if v.shape[-1] == 3:
        turned[..., 1] = v[..., 1]
    return turned
