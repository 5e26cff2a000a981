"""How a file is to be read where its owner knows better than it tells, and how it was read."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.formats.measure import AXES, UNITS
from motionary.motion.roles import READING_KEYS, FileMapping, checked_mapping, load_mapping

_SMALLEST, _LARGEST = 1e-6, 1e6  # metres per unit: a micrometre, a thousand kilometres
_SWITCHES = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


@dataclass(frozen=True)
class ReadingOptions:
    """What the user says about a file; None is measured.

    Attributes:
        up: the file's axis that points up: "y", "z", "x", "-y", "-z" or "-x".
        unit: metres per unit, or a key of `motionary.formats.measure.UNITS` ("m", "cm", "mm", "dm", "in", "ft", "cmu").
        mirror: reflect left and right, as a file of a left-handed world needs.
        skip_first: drop the first frame, a calibration pose.
        mapping: joint name by role, for rigs that are not known.
        usual: by "up", "unit" and "mirror", log-odds by value in favour of what other files of the same rig hold.
        body: a body model's .npz, on whose joints SMPL poses (AMASS) are read, of the shape that the file tells.
        progress: show a bar while a text file is read that takes longer than a second.

    Raises:
        InputError: an option has no such value.
    """

    up: str | None = None
    unit: str | float | None = None
    mirror: bool | None = None
    skip_first: bool | None = None
    mapping: Mapping[str, str] | None = field(default=None, hash=False)
    usual: Mapping[str, Mapping[str, float]] | None = field(default=None, hash=False)
    body: str | os.PathLike | None = None
    progress: bool | None = None

    def __post_init__(self):
        if self.up is not None:
            up = str(self.up).lower().replace("+", "")
            if up not in AXES:
                raise InputError("up", self.up, f"must be one of {', '.join(AXES)} (None: measured)")
            object.__setattr__(self, "up", up)
        if self.unit is not None and not _SMALLEST <= self.scale <= _LARGEST:
            rule = f"must be metres per unit, {_SMALLEST:g} to {_LARGEST:g}, or one of {', '.join(UNITS)}"
            raise InputError("unit", self.unit, rule)
        if self.body is not None and (not isinstance(self.body, str | os.PathLike) or not str(self.body)):
            raise InputError("body", self.body, "must be the path of a body model (.npz)")
        for name in ("mirror", "skip_first"):
            value = getattr(self, name)
            value = _SWITCHES.get(value.lower(), value) if isinstance(value, str) else value
            if value not in (None, True, False):
                raise InputError(name, value, "must be true or false (None: measured)")
            object.__setattr__(self, name, None if value is None else bool(value))

    @property
    def scale(self) -> float:
        """Metres per unit; not above 0 where the unit is wrong."""
        if isinstance(self.unit, bool):
            return 0.0
        if isinstance(self.unit, str) and self.unit.lower() in UNITS:
            return UNITS[self.unit.lower()]
        try:
            scale = float(self.unit)  # type: ignore[arg-type]
        except (TypeError, ValueError, OverflowError):
            return 0.0
        return scale if np.isfinite(scale) else 0.0

    @staticmethod
    def from_mapping(given: Path | str | Mapping[str, Any]) -> ReadingOptions:
        """The options of a mapping (a JSON file or a dict): joint names by role, and `READING_KEYS` beside them.

        A `body` is a path as seen from the file.

        Raises:
            InputError: an unreadable file, an unknown key or a wrong value; the file is named.
        """
        values = load_mapping(given)
        roles, named = FileMapping(checked_mapping(given)), "" if isinstance(given, Mapping) else str(given)
        roles.where = named or "mapping"
        told = {key: values[key] for key in READING_KEYS if key in values}
        if named and isinstance(told.get("body"), str):
            told["body"] = str(Path(named).parent / told["body"])
        return ReadingOptions.told_at(named, mapping=roles or None, **told)

    @staticmethod
    def told_at(where: str, **values: Any) -> ReadingOptions:
        """The options, with the place they come from, which error messages name."""
        try:
            return ReadingOptions(**values)
        except InputError as error:
            raise InputError(f"{where}: {error.what}" if where else error.what, error.value, error.rule) from None

    def over(self, other: ReadingOptions | None) -> ReadingOptions:
        """These options, filled up with the other's where these are None."""
        if other is None:
            return self
        return replace(other, **{f.name: value for f in fields(self) if (value := getattr(self, f.name)) is not None})


@dataclass(frozen=True)
class Reading:
    """How a motion was read.

    Attributes:
        up: the file's axis that became y.
        unit: metres per unit of the file.
        mirrored: whether left and right were reflected.
        skipped_first: whether the first frame was left out as a calibration pose.
        roles: where the joints' roles come from: "names", "tree", "mapping", or "unknown".
        told: which of these the user gave.
        probability: of what was measured, 0 to 1 by option.
        seen: of what was measured, log-odds by option and value of this file's evidence alone, 0 for the best.
        notes: lines about thin or contradicting evidence, each with how to say otherwise.
    """

    up: str = "y"
    unit: float = 1.0
    mirrored: bool = False
    skipped_first: bool = False
    roles: str = "names"
    told: tuple[str, ...] = ()
    probability: Mapping[str, float] = field(default_factory=dict)
    seen: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def line(self) -> str:
        """All of it in one line, for people."""

        def how(option: str) -> str:
            """Whether an option was given, or how sure its measurement is."""
            sure = (
                "given"
                if option in self.told
                else f"{self.probability[option]:.0%}"
                if option in self.probability
                else ""
            )
            return f" ({sure})" if sure else ""

        parts = [f"up {self.up}{how('up')}", f"unit {self.unit:.4g} m{how('unit')}"]
        parts.append(f"{'mirrored' if self.mirrored else 'not mirrored'}{how('mirror')}")
        if self.skipped_first:
            parts.append(f"first frame left out{how('skip_first')}")
        return ", ".join([*parts, f"roles by {self.roles}"])


def nearest_key(key: str, known: Iterable[str]) -> str:
    """ "; did you mean 'x'?", or nothing where no known key is near."""
    near = get_close_matches(key.lower(), list(known), 1, 0.6)
    return f"; did you mean {near[0]!r}?" if near else ""
