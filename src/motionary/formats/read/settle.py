"""What a file's axes, sides and unit are: what the user says, else what is measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from motionary.formats.measure import AXES, UNITS, BodyFrame, Choice, body_of, measure_mirror, measure_unit, measure_up
from motionary.formats.measure.handedness import USUAL as USUAL_SIDES
from motionary.formats.measure.unit import USUAL as USUAL_UNIT
from motionary.formats.measure.unit import plausible
from motionary.formats.measure.up import USUAL as USUAL_UP
from motionary.formats.measure.up import standing_axis
from motionary.formats.read.reading_options import Reading, ReadingOptions
from motionary.motion.rotations import quat_action, quat_conjugation, quat_product

_HALF = np.sqrt(0.5)
# The rotation that turns each axis into y.
TURNS = {
    "y": np.array([0.0, 0, 0, 1]),
    "z": np.array([-_HALF, 0, 0, _HALF]),  # (x, y, z) -> (x, z, -y)
    "-y": np.array([1.0, 0, 0, 0]),  # (x, -y, -z), a camera's axes
    "-z": np.array([_HALF, 0, 0, _HALF]),
    "x": np.array([0, 0, _HALF, _HALF]),
    "-x": np.array([0, 0, -_HALF, _HALF]),
}
_LONGEST_CHAIN = 1.35  # metres from the root to the end of the longest chain, where nothing else is known of a rig


@dataclass(frozen=True)
class Settled:
    """How to bring a file into metres, y up: the turn of the world, the turn of the rest pose, and the reading."""

    reading: Reading
    world: np.ndarray
    rest: np.ndarray

    def points(self, positions: np.ndarray) -> np.ndarray:
        """Positions (..., 3) of the world in metres, y up."""
        return self._reflected(self._turned(self.world, positions)) * self.reading.unit

    def offsets(self, offsets: np.ndarray) -> np.ndarray:
        """Rest offsets (..., 3) likewise."""
        return self._reflected(self._turned(self.rest, offsets)) * self.reading.unit

    def rotations(self, local: np.ndarray) -> np.ndarray:
        """Local rotations (T, J, 4) of a rig whose rest pose turns too: R q R^-1, and W q R^-1 for the root."""
        if self.reading.up != "y" or not np.array_equal(self.rest, TURNS["y"]):
            back = np.broadcast_to(quat_conjugation(self.rest), local.shape)
            front = np.broadcast_to(self.rest, local.shape).copy()
            front[:, 0] = self.world
            local = quat_product(quat_product(front, local), back)
        return local * np.array([1.0, -1, -1, 1]) if self.reading.mirrored else local

    def _reflected(self, points: np.ndarray) -> np.ndarray:
        return points * np.array([-1.0, 1, 1]) if self.reading.mirrored else points

    @staticmethod
    def _turned(turn: np.ndarray, points: np.ndarray) -> np.ndarray:
        return points if np.array_equal(turn, TURNS["y"]) else quat_action(turn, points)


def settle(
    positions: np.ndarray,
    roles: dict[str, int],
    fps: float,
    options: ReadingOptions,
    rest: np.ndarray | None = None,
    chain: float | None = None,
    usual: Mapping[str, Mapping[str, float]] | None = None,
) -> Settled:
    """Decide up, unit and handedness.

    Args:
        positions: (T, J, 3) as the file has them.
        roles: joint by role.
        fps: frames per second.
        options: what the user says.
        rest: (J, 3) the rest pose, where the file has one.
        chain: length of the rig's longest chain, by which a rig without known roles is scaled.
        usual: by "up" and "unit", log-odds in favour of what such files hold.
    """
    such = _usual(usual or {}, {})
    usual = _usual(usual or {}, options.usual or {})
    told = tuple(name for name in ("up", "unit", "mirror", "skip_first") if getattr(options, name) is not None)
    body = None if {"up", "unit", "mirror"} <= set(told) else body_of(positions, roles, fps, rest)
    if body is None or not body.solid:
        return _without_body(body, options, told, chain)
    choices: dict[str, Choice] = {}
    if options.up is None:
        choices["up"] = measure_up(body, usual["up"])
    up = options.up or choices["up"].value
    if options.mirror is None:
        choices["mirror"] = measure_mirror(body, np.array(AXES[up], np.float64), usual["mirror"])
    if options.unit is None:
        choices["unit"] = measure_unit(body.size, usual["unit"])
    mirrored = options.mirror if options.mirror is not None else choices["mirror"].value == "yes"
    scale = options.scale if options.unit is not None else UNITS[choices["unit"].value]
    reading = Reading(
        up=up,
        unit=scale,
        mirrored=bool(mirrored),
        told=told,
        probability={name: choice.probability for name, choice in choices.items()},
        seen={name: choice.seen for name, choice in choices.items()},
        notes=tuple(_doubts(choices, such) + _odd_size(body, scale, options)),
    )
    standing = standing_axis(body) if rest is not None else None
    return Settled(reading, TURNS[up], TURNS[standing or up])


def _usual(
    such: Mapping[str, Mapping[str, float]], rig: Mapping[str, Mapping[str, float]]
) -> dict[str, dict[str, float]]:
    """By option: log-odds in favour of what such files hold, and of what other files of the same rig hold."""
    result = {}
    for option, usual in {"up": USUAL_UP, "unit": USUAL_UNIT, "mirror": USUAL_SIDES}.items():
        favour, known = such.get(option, usual), rig.get(option, {})
        result[option] = {name: favour.get(name, 0.0) + known.get(name, 0.0) for name in (*favour, *known)}
    return result


def _without_body(
    body: BodyFrame | None, options: ReadingOptions, told: tuple[str, ...], chain: float | None
) -> Settled:
    """Where nothing can be measured: y up, as named, in metres or by the rig's longest chain."""
    up, scale = options.up or "y", options.scale if options.unit is not None else 1.0
    if options.unit is None and chain:
        scale = min(UNITS.values(), key=lambda unit: abs(np.log(chain * unit / _LONGEST_CHAIN)))
    notes = ()
    if untold := [name for name in ("up", "unit", "mirror") if name not in told]:
        why = "these points keep no bone lengths" if body is not None else "the joints' roles are not known"
        taken = {"up": f"{up} up", "unit": f"{scale:.4g} m a unit", "mirror": "left and right as named"}
        notes = (
            f"{why}, so nothing was measured; took {', '.join(taken[name] for name in untold)} {_otherwise(untold)}",
        )
    reading = Reading(up=up, unit=scale, mirrored=bool(options.mirror), told=told, roles="unknown", notes=notes)
    return Settled(reading, TURNS[up], TURNS[up])


def _doubts(choices: dict[str, Choice], such: Mapping[str, Mapping[str, float]]) -> list[str]:
    """Where evidence is thin, or other files of the same rig decided against what this one shows."""
    found = []
    for name, choice in choices.items():
        alone = max(choice.seen, key=lambda value: choice.seen[value] + such[name].get(value, 0.0))
        if alone != choice.value:
            took = f"took {choice.value} as other files of its rig have it, where this one by itself would be {alone}"
            found.append(f"{name}: {took} {_otherwise([name])}")
        elif not choice.sure:
            took = f"{choice.value} as {name} (next: {choice.other})"
            if name == "mirror":
                took = "left and right as named" if choice.value == "no" else "left and right swapped"
            found.append(f"{name} is uncertain: took {took} with {choice.probability:.0%} {_otherwise([name])}")
    return found


def _odd_size(body: BodyFrame, scale: float, options: ReadingOptions) -> list[str]:
    if plausible(body.size * scale) > -6:
        return []
    tall = body.size * scale * 1.32
    if options.unit is not None:
        return [f"a body of about {tall:.2g} m, with the unit that was given"]
    return [f"a body of about {tall:.2g} m fits no unit; took {scale:.4g} m a unit {_otherwise(['unit'])}"]


def _otherwise(names: list[str]) -> str:
    """How to override what was measured, in a shell and in Python."""
    flags, arguments = ", ".join(f"--{name}" for name in names), ", ".join(f"{name}=" for name in names)
    return f"(say otherwise with {flags}; in Python {arguments})"


def with_roles(settled: Settled, source: str, notes: list[str]) -> Settled:
    """The same with where roles came from, and what contradicts them."""
    reading = settled.reading
    return replace(settled, reading=replace(reading, roles=source, notes=(*reading.notes, *notes)))
