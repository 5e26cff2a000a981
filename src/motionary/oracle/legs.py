"""Where the body goes and what trunk and legs do."""

from __future__ import annotations

import numpy as np

from motionary.oracle.episodes import episodes, reversals, spans
from motionary.oracle.signals import Signals, share
from motionary.oracle.thresholds import Thresholds


def moving(s: Signals, cut: Thresholds) -> np.ndarray:
    """(T,) bool: the root travels."""
    return np.sqrt(np.square(s.velocity).sum(-1)) > cut.still * s.leg


def pace(s: Signals, cut: Thresholds) -> tuple[float, float, float]:
    """Speed (leg lengths per second, median), steps per second and flight (leg lengths) while the root travels."""
    frames = moving(s, cut)
    if not frames.any():
        return 0.0, 0.0, 0.0
    speed = float(np.median(np.sqrt(np.square(s.velocity[frames]).sum(-1)))) / s.leg
    stride = (s.foot[:, 0, 2] - s.foot[:, 1, 2])[frames]
    steps = reversals(stride - stride.mean(), 0.1) * s.fps / len(stride)
    return speed, steps, float(share(s.lift[frames].min(1), 0.9))


def gait(s: Signals, cut: Thresholds) -> tuple[str, float]:
    """ "still", "walk" or "run", and the speed in m/s while travelling."""
    speed, steps, flight = pace(s, cut)
    reached = np.sqrt(np.square(s.path - s.path[0]).sum(-1)).max()
    if reached < 0.35 * s.leg or speed == 0:
        return "still", speed * s.leg
    effort = speed / cut.run_speed + steps / cut.run_steps + flight / cut.run_flight
    return ("run" if effort > 1 else "walk"), speed * s.leg


def bearing(s: Signals) -> tuple[float, float]:
    """Angle from where the body faces to where it goes, degrees, positive to the left; and how far it goes, m."""
    left, forward = s.velocity.sum(0) / s.fps
    return float(np.degrees(np.arctan2(left, forward))), float(np.hypot(left, forward))


def direction(s: Signals, cut: Thresholds) -> str:
    """Where the body goes as seen by itself."""
    angle, distance = bearing(s)
    if distance < 0.2 * s.leg:
        return "none"
    if abs(angle) > 135:
        return "backward"
    if abs(angle) > cut.sideways:
        return "left" if angle > 0 else "right"
    return "forward"


def displacement(s: Signals) -> tuple[float, float]:
    """(left, forward) metres from the first to the last frame in the frame of the heading at the start."""
    first = np.radians(s.heading[: max(1, round(0.25 * s.fps))].mean())
    x, z = s.path[-1] - s.path[0]
    return float(x * np.cos(first) - z * np.sin(first)), float(x * np.sin(first) + z * np.cos(first))


def turns(s: Signals) -> tuple[float, float]:
    """Largest changes of heading to the left and to the right, degrees >= 0."""
    left = (s.heading - np.minimum.accumulate(s.heading)).max()
    right = (np.maximum.accumulate(s.heading) - s.heading).max()
    return float(left), float(right)


def jumps(s: Signals, cut: Thresholds) -> int:
    """Flights of both feet together."""
    both = s.lift.min(1)
    count = 0
    for begin, end in spans(both, cut.flight, cut.flight / 2):
        top = begin + int(both[begin : end + 1].argmax())
        count += bool(abs(s.lift[top, 0] - s.lift[top, 1]) < 0.2)
    return count


def hops(s: Signals, cut: Thresholds) -> list[int]:
    """Flights on each leg: the other foot stays off the floor before, in and after the flight."""
    counts = [0, 0]
    around = max(1, round(0.15 * s.fps))
    for begin, end in spans(s.lift.min(1), cut.flight / 2, cut.flight / 4):
        stretch = s.lift[max(0, begin - around) : end + around + 1]
        side = int(stretch[:, 0].mean() > stretch[:, 1].mean())
        counts[side] += bool(stretch[:, 1 - side].min() > cut.flight)
    return counts


def squats(s: Signals, cut: Thresholds) -> tuple[int, int]:
    """How often the hips go down over the feet, and how often behind them, as on a seat."""
    down = spans(-s.rise, -cut.squat, -cut.stand)
    seated = [s.foot[begin : end + 1, :, 2].mean() > cut.seat for begin, end in down]
    sits = int(sum(seated))
    return len(down) - sits, sits


def bows(s: Signals, cut: Thresholds) -> int:
    """How often the trunk bends forward while the legs stand."""
    return episodes(np.where(s.rise > cut.squat, s.lean[:, 1], 0), cut.bow, 0.6 * cut.bow)


def leans(s: Signals, cut: Thresholds) -> list[int]:
    """How often the trunk bends to the left and to the right."""
    return [episodes(sign * s.lean[:, 0], cut.lean, 0.6 * cut.lean) for sign in (1, -1)]


def kicks(s: Signals, cut: Thresholds) -> list[int]:
    """How often each leg swings up stretched, to the front or to the outside."""
    counts = []
    for side in range(2):
        up = s.foot[:, side, 1] - s.foot[:, 1 - side, 1]
        away = np.maximum(s.foot[:, side, 2], s.foot[:, side, 0] * (1 - 2 * side))
        stretched = np.sqrt(np.square(s.foot[:, side]).sum(-1)) > 0.75
        counts.append(episodes(np.where(stretched, np.minimum(up, away), 0), cut.kick, cut.kick / 2))
    return counts


def lunges(s: Signals, cut: Thresholds) -> list[int]:
    """How often each foot stands far ahead of the other while the hips sink."""
    ahead = s.foot[:, 0, 2] - s.foot[:, 1, 2]
    return [episodes(np.where(s.rise < cut.lunge_rise, sign * ahead, 0), cut.lunge, cut.lunge / 2) for sign in (1, -1)]


def knees(s: Signals, cut: Thresholds) -> list[int]:
    """How often each knee is lifted well above the other."""
    over = s.knee - s.knee[:, ::-1]
    lifted = np.minimum(s.knee - cut.knee, over - 0.15)
    return [episodes(lifted[:, side], 0, -0.12) for side in range(2)]
