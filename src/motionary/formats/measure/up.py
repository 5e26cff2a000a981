"""Which axis of a file points up: six candidates, weighed by what gravity and the ground do to a body over a clip.

No posture decides: people lie, sit and stand on their hands. The weights are log-odds, fitted as a conditional logit on
the CMU takes turned to all six axes and rounded by hand; each pulls the way that its comment says.
"""

from __future__ import annotations

import numpy as np

from motionary.formats.measure.body_frame import BodyFrame, rank, unit
from motionary.formats.measure.evidence import Choice, choose

AXES = {"y": (0, 1, 0), "z": (0, 0, 1), "-y": (0, -1, 0), "-z": (0, 0, -1), "x": (1, 0, 0), "-x": (-1, 0, 0)}
_DIRECTIONS = np.array(list(AXES.values()), np.float64)

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
}
# What programs write, before anything is seen.
_USUAL = {"y": 1.0, "z": 0.5}
_TRAVEL = 1e-3


def measure_up(body: BodyFrame, usual: dict[str, float] | None = None) -> Choice:
    """The axis (a key of `AXES`) that points up.

    Args:
        body: in the file's axes.
        usual: log-odds by axis in favour of what such files hold; None: y, then z.
    """
    evidence = _evidence(body)
    scores = np.array(list(_WEIGHTS.values())) @ np.stack([evidence[what] for what in _WEIGHTS])
    favour = _USUAL if usual is None else usual
    return choose(list(AXES), [float(s) + favour.get(name, 0.0) for name, s in zip(AXES, scores, strict=True)])


def _evidence(body: BodyFrame) -> dict[str, np.ndarray]:
    """(6,) for each weight, over the candidates."""
    up = _DIRECTIONS.T
    height = np.moveaxis(body.places @ up, -1, 0)  # (6, T, R)
    lowest = height.min(-1)
    above = height - lowest[..., None]
    ordered = np.sort(lowest, axis=1)
    ground, low, high = (ordered[:, round(share * (lowest.shape[1] - 1))] for share in (0.05, 0.1, 0.9))
    bearing = np.exp(-above / 0.05)
    slip = (bearing * np.minimum(body.speeds, 3)).sum(-1) / bearing.sum(-1)
    still = np.exp(-body.speeds / 0.15) + 1e-12
    still /= still.sum(-1, keepdims=True)
    moving = np.clip(rank(body.speeds.T, 0.5) / 0.15, 0.02, 1)
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
        "still joint is high": (above * still).sum(-1) @ moving / moving.sum(),
        "travels along it": way @ np.abs(up) / way.max(),
        "side leans into it": np.sqrt(((body.across @ up) ** 2).mean(0)),
        "pelvis above zero": np.clip(rank(hips, 0.5) @ up / 0.08, -1, 1),
        "starts at zero": np.exp(-np.abs(body["pelvis"][0] @ up) / 0.02),
        "rest pose stands along it": _standing(body.at_rest),
    }


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
