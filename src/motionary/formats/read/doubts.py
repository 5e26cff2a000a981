"""What no person's motion shows, and a wrong unit or rate does. It is told, never refused: it may be true."""

from __future__ import annotations

import numpy as np

from motionary.motion import Motion

_SLOWEST, _FASTEST = 5.0, 1000.0  # frames per second, beyond which nobody records people
_SPRINT = 12.0  # m/s
_INSTANTS, _STEP = 200, 0.1  # enough to judge by; seconds over which speeds are taken
_ROLES = ("pelvis", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle")
# Legs that the lowest joint is off the ground; how well heights and speeds must go along with what the legs show; how
# near, in logarithms, the factor in them must be to that of the whole height; metres a second that feet move at least,
# and legs by which heights vary. They are set so that sound clips are not told, rather than that all wrong ones are.
_OFF_GROUND, _HEIGHTS_AGREE, _SPEEDS_AGREE, _NEAR, _FEET_MOVE, _RISES = 0.5, 0.95, 0.6, 0.25, 0.1, 0.01
_RATE = "--source-fps or --fps"


def doubts_of(motion: Motion, rate_given: bool) -> list[str]:
    """What to say of a motion in metres, y up, as it was read; each with how to say otherwise.

    Args:
        motion: of any rig; of one without legs the rate alone is judged.
        rate_given: whether the user said it.
    """
    if motion.frames < 2:
        return []
    found = []
    if not rate_given and not _SLOWEST <= motion.fps <= _FASTEST:
        found.append(f"a rate of {motion.fps:g} per second is unusual (say otherwise with {_RATE}; in Python fps=)")
    roles = motion.skeleton.roles
    if not all(role in roles for role in _ROLES):
        return found
    joints = [roles[role] for role in _ROLES] + [joint for role, joint in roles.items() if role not in _ROLES]
    step = max(1, min(round(motion.fps * _STEP), (motion.frames - 1) // 10))
    at = np.unique(np.linspace(0, motion.frames - 1 - step, _INSTANTS).astype(int))
    places = motion.positions[at[:, None], joints].astype(np.float64)
    moved = motion.positions[(at + step)[:, None], joints] - places
    speeds = moved * (motion.fps / step)
    speed = float(np.median(np.linalg.norm(speeds[:, 0, [0, 2]], axis=-1)))
    if speed > _SPRINT:
        otherwise = f"(say otherwise with {_RATE}, --unit; in Python fps=, unit=)"
        found.append(f"the pelvis moves at {speed:.3g} m/s: another rate, or another unit? {otherwise}")
    if times := _root_scaled(places, speeds):
        otherwise = "(say otherwise by dividing them by that in the file)"
        found.append(f"the root's places are {times:.3g} times those that its legs reach: another unit? {otherwise}")
    return found


def _root_scaled(places: np.ndarray, speeds: np.ndarray) -> float | None:
    """How many times too large the root's places are for its legs; None where both fit, or too little tells.

    A foot on the ground stays while the body moves over it, so that the legs tell how fast the pelvis goes; and how
    high they carry it is known. Where the root is in another unit, it goes, or rises and sinks, as many times too far
    as it is too high over zero. A body on a platform, on a treadmill or moved to the origin has one of both alone.

    Args:
        places: (n, R, 3) joints in the order of `_ROLES`, and others.
        speeds: (n, R, 3) per second.
    """
    high, lowest = places[:, 0, 1], places[..., 1].min(1)
    leg = float(np.median(np.linalg.norm(places[:, 1:5] - places[:, 3:7], axis=-1).sum(1) / 2))
    carried = high - lowest
    if abs(np.median(lowest)) < _OFF_GROUND * leg or min(np.median(high), np.median(carried)) <= 0:
        return None
    times = float(np.median(high) / np.median(carried))
    standing = places[:, 5:7, 1].argmin(1)
    over_foot = speeds[:, 0] - speeds[np.arange(len(speeds)), 5 + standing]
    told = [
        _slope(high - high.mean(), carried - carried.mean(), _RISES * leg, _HEIGHTS_AGREE),
        _slope(speeds[:, 0], over_foot, _FEET_MOVE, _SPEEDS_AGREE),
    ]
    fits = any(slope and abs(np.log(slope / times)) < _NEAR * abs(np.log(times)) for slope in told)
    return times if fits else None


def _slope(of: np.ndarray, by: np.ndarray, least: float, agree: float) -> float | None:
    """How many times `by` (n,) or (n, 3) `of` is; None where `by` is below `least` or they go less together."""
    own, both, theirs = (float((a * b).sum()) for a, b in ((of, of), (of, by), (by, by)))
    goes = theirs >= least**2 * len(by) and both > agree * (own * theirs) ** 0.5
    return both / theirs if goes else None
