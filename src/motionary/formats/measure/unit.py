"""How many metres a file's unit is: the one under which the body has a size that people have."""

from __future__ import annotations

import math

from motionary.formats.measure.evidence import Choice, choose

# Metres per unit: and "cmu", the unit of the Acclaim files of CMU and of what was made from them (cgspeed's
# MotionBuilder conversion): 0.45 of them are an inch.
CMU_UNIT = 0.0254 / 0.45
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "cmu": CMU_UNIT, "dm": 0.1, "ft": 0.3048}
USUAL = {"m": 0.0, "cm": 0.0, "mm": -0.5, "in": -0.5, "cmu": -1.0, "dm": -1.0, "ft": -3.0}  # log-odds before any look

# Leg and trunk together are about three quarters of the stature: 1.30 m of 1.72.
_ADULT, _SPREAD = 1.30, 0.08  # median, and standard deviation of the logarithm
_TALLEST = 2.3 * 0.77  # nobody is above 2.3 m
_CHILD, _CHILD_SPREAD = 0.85, 0.22  # of 1.13 m, about six years old
_CHILD_SHARE = 0.05


def measure_unit(size: float, usual: dict[str, float] | None = None) -> Choice:
    """The unit (a key of `UNITS`) of a body's leg and trunk; log-odds `usual` in favour of what such files hold."""
    seen = [plausible(size * scale) for scale in UNITS.values()]
    return choose(list(UNITS), seen, USUAL if usual is None else usual)


def plausible(size: float) -> float:
    """Log-density of people's leg and trunk in metres: adults about 1.30, some children, nobody above 2.3 m tall."""
    log = math.log(max(size, 1e-9))
    density = (1 - _CHILD_SHARE) * _bell(log, _ADULT, _SPREAD) + _CHILD_SHARE * _bell(log, _CHILD, _CHILD_SPREAD)
    # Beyond all people the distance still orders the candidates, and costs more above than below.
    far = -60 * max(0.0, log - math.log(_TALLEST)) - 10 * max(0.0, math.log(_CHILD / 2) - log)
    return math.log(density + 1e-9) + far


def _bell(log: float, middle: float, spread: float) -> float:
    """Normal density of the logarithm of a size."""
    return math.exp(-0.5 * ((log - math.log(middle)) / spread) ** 2) / (spread * math.sqrt(2 * math.pi))
