"""`fit_thresholds`: fix the oracle's learned cuts on labeled training clips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from motionary.errors import InputError
from motionary.oracle import arms, legs
from motionary.oracle.claims import expected
from motionary.oracle.signals import signals
from motionary.oracle.thresholds import DEFAULT, Thresholds

if TYPE_CHECKING:
    from motionary.motion import Motion

_SIDES = ("left", "right")


def fit_thresholds(motions: Sequence[Motion], labels: Sequence[str], base: Thresholds = DEFAULT) -> Thresholds:
    """Cuts that best separate labeled clips: raised hands, waves, running, sideways walking, turning.

    Use training clips only. A cut without examples on both sides keeps its value in `base`.

    Args:
        motions: training clips.
        labels: a caption or action label for each ("raise-up-left-hand"), read by `expected`.
        base: all other thresholds.
    """
    if len(motions) != len(labels):
        raise InputError("labels", len(labels), f"need one per motion ({len(motions)})")
    clips = [(signals(m), claims) for m, label in zip(motions, labels, strict=True) if (claims := expected(label))]
    cuts = {
        "raise_standing": _cut(*_hands(clips, lambda s: arms.elevation(s))),
        "sideways": _cut(*_split(clips, lambda s: abs(legs.bearing(s)[0]), _goes_sideways)),
        "turn": _cut(*_split(clips, lambda s: max(legs.turns(s)), _turns)),
    }
    fitted = replace(base, **{name: value for name, value in cuts.items() if value is not None})
    swings = _cut(*_waves(clips, fitted))
    if swings is not None:
        fitted = replace(fitted, wave_swings=swings)
    walks, runs = _split(clips, lambda s: legs.pace(s, fitted), _runs)
    return replace(fitted, **_running(walks, runs)) if len(walks) and len(runs) else fitted


def _cut(low: np.ndarray, high: np.ndarray) -> float | None:
    """The number with the best balanced accuracy for `low` below and `high` above it; the middle of the best ones."""
    if not len(low) or not len(high):
        return None
    values = np.unique(np.concatenate([low, high]))
    middles = np.concatenate([values[:1] - 1e-3, (values[1:] + values[:-1]) / 2, values[-1:] + 1e-3])
    right = np.searchsorted(np.sort(low), middles) / len(low) - np.searchsorted(np.sort(high), middles) / len(high)
    best = np.flatnonzero(right >= right.max() - 1e-12)
    return float((middles[best[0]] + middles[best[-1]]) / 2)


def _hands(clips, measure) -> tuple[np.ndarray, np.ndarray]:
    """A measure (2,) of hands that stay down and of hands that rise, in clips that say which."""
    down, up = [], []
    for s, claims in clips:
        side = claims.get("raised")
        if side is None or "gait" in claims:
            continue
        values = measure(s)
        for k, name in enumerate(_SIDES):
            # Other claims (a kick after the wave) may move the other hand.
            (up if side in (name, "both") else down if set(claims) <= {"raised", "waving"} else []).append(values[k])
    return np.array(down), np.array(up)


def _waves(clips, cut: Thresholds) -> tuple[np.ndarray, np.ndarray]:
    """Swings of hands that are only raised and of hands that wave."""
    raised, waving = [], []
    for s, claims in clips:
        side = claims.get("raised")
        if side is None or "waving" not in claims:
            continue
        swings = arms.swings(s, cut)
        values = swings.tolist() if side == "both" else [swings[_SIDES.index(side)]]
        (raised if claims["waving"] == "none" else waving).extend(values)
    return np.array(raised), np.array(waving)


def _split(clips, measure, test) -> tuple[np.ndarray, np.ndarray]:
    """Measures of clips where the test of claims is False, and where it is True (None: the clip says nothing)."""
    groups: tuple[list, list] = ([], [])
    for s, claims in clips:
        answer = test(claims)
        if answer is not None:
            groups[answer].append(measure(s))
    return np.array(groups[0]), np.array(groups[1])


def _travels(claims) -> bool:
    return set(claims) <= {"gait", "direction", "turned"} and claims.get("gait") != "still"


def _goes_sideways(claims) -> bool | None:
    if not _travels(claims) or claims.get("direction") == "backward" or not {"gait", "direction"} & set(claims):
        return None
    return claims.get("direction") in _SIDES


def _turns(claims) -> bool | None:
    return "turned" in claims if _travels(claims) else None


def _runs(claims) -> bool | None:
    return claims["gait"] == "run" if _travels(claims) and "gait" in claims else None


def _running(walks: np.ndarray, runs: np.ndarray) -> dict[str, float]:
    """Scales of speed, steps and flight whose weighted sum best tells running from walking.

    Args:
        walks, runs: (N, 3) paces.

    Every weight is positive (more of each must speak for running) and they are tried in tenths.
    """
    scale = np.concatenate([walks, runs]).std(0) + 1e-6
    tried = []
    for shares in np.array([(a, b, 10 - a - b) for a in range(1, 9) for b in range(1, 10 - a)]):
        low, high = walks @ (shares / scale), runs @ (shares / scale)
        cut = _cut(low, high)
        tried.append(((low < cut).mean() + (high > cut).mean(), int(shares.min()), cut * scale / shares))
    # Of those as good as the best within half a percent, the one that leans on no single measure.
    best = max(score for score, _, _ in tried)
    found = max((t for t in tried if t[0] >= best - 0.01), key=lambda t: (t[1], t[0]))[2]
    return dict(zip(("run_speed", "run_steps", "run_flight"), found.tolist(), strict=True))
