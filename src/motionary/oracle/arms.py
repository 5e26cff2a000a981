"""What the hands do."""

from __future__ import annotations

import numpy as np

from motionary.oracle.episodes import episodes, reversals, spans
from motionary.oracle.signals import Signals, share, smooth
from motionary.oracle.thresholds import Thresholds


def elevation(s: Signals) -> np.ndarray:
    """(2,) height of each wrist over its shoulder at its highest (95th percentile over time), arm lengths."""
    return share(s.wrist[:, :, 1], 0.95)


def raised(s: Signals, cut: Thresholds, moving: bool) -> np.ndarray:
    """(2,) bool: the hand rises. Swinging arms of walkers come near the shoulder, so they must rise further."""
    return elevation(s) > (max(cut.raise_moving, cut.raise_standing) if moving else cut.raise_standing)


def swings(s: Signals, cut: Thresholds) -> np.ndarray:
    """(2,) changes of direction of each hand while it is up, along the axis where it swings most.

    In a large wave the hand leaves the raised height and comes back: each return counts as two more changes. Movements
    no larger than the hand's noise from frame to frame do not count.
    """
    counts = np.zeros(2, int)
    high = elevation(s)
    for side in range(2):
        least = max(cut.swing / 2, cut.over_noise * s.shake[side])
        stays = spans(s.wrist[:, side, 1], high[side] - 0.35, high[side] - 0.8)
        counts[side] = 2 * (len(stays) - 1)
        for begin, end in stays:
            hand = s.wrist[begin : end + 1, side]
            hand = hand - smooth(hand, 0.9 * s.fps)  # what is slower than a wave is no wave
            counts[side] += max(reversals(hand[:, axis], least) for axis in range(3))
    return counts


def raises(s: Signals, cut: Thresholds) -> list[int]:
    """How often each hand goes up and comes down at least half of the way."""
    up = s.wrist[..., 1]
    level = np.maximum(cut.raise_standing, 0.75 * elevation(s))
    return [episodes(up[:, side], level[side], min(level[side] - 0.4, 0)) for side in range(2)]


def pointing(s: Signals, cut: Thresholds) -> np.ndarray:
    """(2,) bool: the straight arm stays near the horizontal for a while."""
    reach = np.sqrt(np.square(s.wrist).sum(-1))
    level = (np.abs(s.wrist[..., 1]) < 0.35) & (reach > 0.85)
    return level.sum(0) / s.fps > cut.point_time


def punches(s: Signals, cut: Thresholds) -> list[int]:
    """Times each fist shoots to the front at about the height of its shoulder and comes back to the bent arm."""
    reach = np.sqrt(np.square(s.wrist).sum(-1))
    ahead = np.where(np.abs(s.wrist[..., 1]) < 0.45, s.wrist[..., 2], 0)
    counts = []
    for side in range(2):
        out = max(cut.punch, 0.8 * ahead[:, side].max())
        state = np.where(ahead[:, side] > out, 1, np.where(reach[:, side] < cut.retract, -1, 0))
        counts.append(episodes(state, 0, 0) if (state < 0).any() else 0)
    return counts


def claps(s: Signals, cut: Thresholds) -> int:
    """Times the hands meet in front of the body."""
    return episodes(-s.hands, -cut.clap, -cut.apart)


def circles(s: Signals) -> list[int]:
    """Full turns of each arm about the shoulder, seen from the side."""
    angle = np.unwrap(np.arctan2(s.wrist[..., 2], -s.wrist[..., 1]), axis=0) / (2 * np.pi)
    return np.round(np.ptp(angle, axis=0)).astype(int).tolist()


def reaches_down(s: Signals, cut: Thresholds) -> np.ndarray:
    """(2,) bool: the hand comes near the floor."""
    return s.over_floor.min(0) < cut.reach_down
