"""Which axis of a file points up: six candidates, weighed by what gravity and the ground do to a body over a clip.

No posture decides: people lie, sit and stand on their hands. The weights are log-odds, fitted as a conditional logit on
the CMU takes turned to all six axes and rounded by hand; each pulls the way that its comment says.
"""

from __future__ import annotations

import numpy as np

from motionary.formats.measure.body_frame import BodyFrame, rank, unit
from motionary.formats.measure.evidence import Choice, choose

AXES = {"y": (0, 1, 0), "z": (0, 0, 1), "x": (1, 0, 0), "-y": (0, -1, 0), "-z": (0, 0, -1), "-x": (-1, 0, 0)}
_DIRECTIONS = np.array(list(AXES.values()), np.float64)
_ORDER = [1, 2, 0]  # coordinates of the first three; the last three point the other way

_WEIGHTS = {
    "head over feet": 2.3,
    "shins upright": 1.6,
    "arms hang": 6.0,
    "ground at zero": 4.0,  # the lowest point of the clip lies at the origin's height
    "below the ground": -3.5,  # part of the time far below the origin's height
    "ground moves": -0.7,  # the height of the lowest joint changes over the clip
    "lowest joint moves": -2.0,  # what stands on the ground stays where it is
    "still joint is high": -0.7,  # what stays where it is, stands on the ground
    "travels along it": -0.9,
    "side leans into it": -2.7,  # the line through hips and shoulders is level
    "pelvis above zero": 1.5,  # the origin is on the ground, and nobody's pelvis is below it
    "starts at zero": -2.0,  # many clips begin over the origin, none with a pelvis in the ground
    "rest pose stands along it": 2.0,
    "falls": 3.0,  # in flight everything is pulled down by 9.8 m/s^2 and nothing pulls sideways
}
# What programs write, before anything is seen.
USUAL = {"y": 1.0, "z": 0.5}
_TRAVEL = 1e-3
# A clip whose pelvis begins in the origin (closer than this, in sizes) was moved there: heights over the origin tell
# nothing of the ground. What is left is mostly posture, which tells standing people from lying ones half as surely.
_ORIGIN, _POSTURE_ALONE = 0.02, 0.5
_OVER_ORIGIN = ("ground at zero", "below the ground", "pelvis above zero", "starts at zero")
# Kinds of evidence that may be all wrong: the origin may lie anywhere, who lies straight looks as if standing, and a
# rest pose may have another axis up than the world. An axis that hangs on one of them alone is said to be uncertain.
_POSTURE, _REST = ("head over feet", "shins upright", "arms hang"), ("rest pose stands along it",)
_DECEIVED = 0.1  # how probable it is of each kind
# A body of which no joint moves farther than this, in sizes, shows one posture in one place: who stands on the ground
# may as well lie with another axis up, whatever both say together.
_STILL = 0.05
# All weights; and the same without what may deceive, the last for bodies that stay still.
_ALL = np.array(
    [
        [0.0 if what in kind else weight for what, weight in _WEIGHTS.items()]
        for kind in ((), _OVER_ORIGIN, _POSTURE + _REST, _REST, _OVER_ORIGIN + _POSTURE)
    ]
)
# Gravity in sizes per second squared, for bodies of 1.15 to 1.5 m; what it may be out of the vertical; instants that
# tell all. On 450 takes 29 have such instants, for the true axis alone. Landing pushes as hard, but no 0.1 s as evenly.
_GRAVITY, _SIDEWAYS, _FLIGHT = (6.5, 8.5), 1.5, 3


def measure_up(body: BodyFrame, usual: dict[str, float] | None = None) -> Choice:
    """The axis (a key of `AXES`) that points up.

    Args:
        body: in the file's axes.
        usual: log-odds by axis in favour of what such files hold; None: y, then z.
    """
    evidence = _evidence(body)
    if centred := np.linalg.norm(body["pelvis"][0]) < _ORIGIN:
        evidence |= dict.fromkeys(_OVER_ORIGIN, np.zeros(len(AXES)))
    trust = _POSTURE_ALONE if centred else 1.0
    weights = _ALL if _still(body) else _ALL[:-1]
    scores, *without = trust * weights @ np.stack([evidence[what] for what in _WEIGHTS])
    return choose(list(AXES), scores, USUAL if usual is None else usual, without, _DECEIVED)


def _still(body: BodyFrame) -> bool:
    """Whether all joints stay where they are."""
    return bool(np.ptp(body.places, axis=0).max() < _STILL)


def _evidence(body: BodyFrame) -> dict[str, np.ndarray]:
    """(6,) for each weight, over the candidates."""
    up = _DIRECTIONS.T
    lowest, above = _heights(body.places)
    ordered = np.sort(lowest, axis=1)
    ground, low, high = (ordered[:, round(share * (lowest.shape[1] - 1))] for share in (0.05, 0.1, 0.9))
    speeds = np.ascontiguousarray(body.speeds.T, np.float32)
    bearing = np.exp(-above / np.float32(0.05))
    slip = np.einsum("rct,rt->ct", bearing, np.minimum(speeds, 3)) / bearing.sum(0)
    still = np.exp(-speeds / np.float32(0.15)) + np.float32(1e-12)
    still /= still.sum(0)
    moving = np.clip(rank(speeds, 0.5) / 0.15, 0.02, 1)
    hips = body.middle("hip")
    head = body["head"] if "head" in body.roles else body.middle("shoulder")
    arms = body.middle("wrist") - body.middle("shoulder")
    shins = (unit(body["left_knee"] - body["left_ankle"]) + unit(body["right_knee"] - body["right_ankle"])) / 2
    way = np.ptp(hips, axis=0) + _TRAVEL
    return {
        "head over feet": unit(head - body.middle("ankle")).mean(0) @ up,
        "shins upright": shins.mean(0) @ up,
        "arms hang": -arms.mean(0) @ up,
        "ground at zero": np.exp(-np.abs(ground) / 0.1),
        "below the ground": (lowest < -0.15).mean(1),
        "ground moves": np.minimum(high - low, 2),
        "lowest joint moves": np.minimum(slip, 2).mean(1),
        "still joint is high": np.einsum("rct,rt->ct", above, still) @ moving / moving.sum(),
        "travels along it": way @ np.abs(up) / way.max(),
        "side leans into it": np.sqrt(((body.across @ up) ** 2).mean(0)),
        "pelvis above zero": np.clip(rank(hips, 0.5) @ up / 0.08, -1, 1),
        "starts at zero": np.exp(-np.abs(body["pelvis"][0] @ up) / 0.02),
        "rest pose stands along it": _standing(body.at_rest),
        "falls": _falls(body.pull),
    }


def _heights(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of (T, R, 3) places: (6, T) the lowest joint's height, and (R, 6, T) every joint's above it, by candidate."""
    points = np.ascontiguousarray(places.transpose(1, 2, 0)[:, _ORDER], np.float32)
    low, high = points.min(0), points.max(0)
    return np.concatenate([low, -high]), np.concatenate([points - low, high - points], axis=1)


def _falls(pull: np.ndarray) -> np.ndarray:
    """(6,) from 0 to 1: how long the body falls freely against the candidate, two instants in a row at least."""
    if len(pull) < 2:
        return np.zeros(len(AXES))
    down = -(pull @ _DIRECTIONS.T)  # (n, 6)
    aside = np.sqrt(np.maximum((pull**2).sum(1, keepdims=True) - down**2, 0))
    free = (down > _GRAVITY[0]) & (down < _GRAVITY[1]) & (aside < _SIDEWAYS)
    return np.minimum((free[1:] & free[:-1]).sum(0) / _FLIGHT, 1)


def standing_axis(body: BodyFrame) -> str | None:
    """The axis along which the rest pose stands, None where it stands along none (as where all bones lie along one)."""
    found = _standing(body.at_rest)
    return list(AXES)[int(np.argmax(found))] if found.any() else None


def _standing(rest: BodyFrame | None) -> np.ndarray:
    """(6,) 1 for the axis along which legs and trunk of a rest pose stand, with the shoulders level."""
    if rest is None:
        return np.zeros(len(AXES))
    up = _DIRECTIONS.T
    trunk = unit(rest.middle("shoulder") - rest.middle("hip"))[0] @ up
    legs = unit(rest.middle("hip") - rest.middle("ankle"))[0] @ up
    return ((trunk > 0.8) & (legs > 0.8) & (np.abs(rest.across[0] @ up) < 0.4)).astype(float)
