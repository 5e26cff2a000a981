"""Whether a file's world is mirrored: its names say left where the body's right side is.

In the body's own frame, forward is the direction from right to left, times up. Knees, toes and faces point forward,
elbows back, and people mostly walk that way; in a left-handed world all of it is the other way round.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from motionary.formats.measure.body_frame import BodyFrame, unit
from motionary.formats.measure.evidence import Choice, choose

# Log-odds for forward being where the names put it, fitted on the CMU takes and rounded.
_WEIGHTS = {"knees": 5.0, "toes": 3.0, "elbows": -2.0, "head": 1.0, "walk": 1.0}
_AT_REST = {"toes": 2.0}  # what the rest pose adds
USUAL = {"no": 1.0}


def measure_mirror(body: BodyFrame, up: np.ndarray, usual: Mapping[str, float] | None = None) -> Choice:
    """ "no" or "yes"; `up` (3,) is the axis that points up; log-odds `usual` in favour of what such files hold."""
    evidence = _evidence(body, up)
    score = sum(weight * evidence[what] for what, weight in _WEIGHTS.items())
    if (rest := body.at_rest) is not None and _stands(rest):
        shape = _evidence(rest, up)
        score += sum(weight * shape[what] for what, weight in _AT_REST.items())
    return choose(("no", "yes"), (score, 0.0), USUAL if usual is None else usual)


def _evidence(body: BodyFrame, up: np.ndarray) -> dict[str, float]:
    """Each from -1 to 1: how far it points where the names of left and right put forward."""
    across = body.across
    ahead = unit(np.cross(across, unit(body.middle("shoulder") - body.middle("hip"))))

    def mean(vectors: np.ndarray, full: float) -> float:
        """Mean from -1 to 1 of how far vectors (T, n, 3) point ahead; `full` sizes or more count as 1."""
        return float((np.einsum("tni,ti->tn", vectors, ahead) / full).clip(-1, 1).mean())

    legs = [body.both(part) for part in ("hip", "knee", "ankle")]
    arms = [body.both(part) for part in ("shoulder", "elbow", "wrist")]
    toes = all(f"{side}_foot" in body.roles for side in ("left", "right"))
    walk = np.einsum("ti,ti->t", body.velocity, unit(np.cross(across, up)))
    return {
        "knees": mean(_off(legs[1] - legs[0], legs[2] - legs[0]), 0.1),
        "elbows": mean(_off(arms[1] - arms[0], arms[2] - arms[0]), 0.1),
        "toes": mean(_off(body.both("foot") - legs[2], legs[2] - legs[1]), 0.05) if toes else 0.0,
        "head": mean((body["head"] - body.middle("shoulder"))[:, None], 0.05) if "head" in body.roles else 0.0,
        "walk": float((walk / 0.5).clip(-1, 1).mean()),
    }


def _stands(rest: BodyFrame) -> bool:
    """Whether the legs go on from the trunk, so that the rest pose has a front."""
    trunk = unit(rest.middle("shoulder") - rest.middle("hip"))
    return bool((trunk * unit(rest.middle("ankle") - rest.middle("hip"))).sum(-1)[0] < -0.7)


def _off(vectors: np.ndarray, line: np.ndarray) -> np.ndarray:
    """The parts of vectors (T, n, 3) at right angles to lines (T, n, 3)."""
    line = unit(line)
    return vectors - np.einsum("tni,tni->tn", vectors, line)[..., None] * line
