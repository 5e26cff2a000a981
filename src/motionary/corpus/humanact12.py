"""The published layout of HumanAct12: a folder of joint arrays whose names say who does what."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from motionary.errors import InputError

# P01G01R01F0001T0064A0101: person, group, recording, its first and last frame, and the action: two digits of the coarse
# one and two of the fine one within it.
_NAME = re.compile(r"P(\d{2})G\d{2}R\d{2}F\d{4}T\d{4}A(\d{2})(\d{2})")
# Of the coarse codes 01 to 12, in their order.
ACTIONS = (
    *("warm up", "walk", "run", "jump", "drink", "lift dumbbell", "sit", "eat", "turn steering wheel", "phone"),
    *("boxing", "throw"),
)


class Labels(NamedTuple):
    """What a name tells; "" where it tells nothing."""

    subject: str = ""
    action: str = ""
    style: str = ""


def labels_of(path: Path) -> Labels:
    """Person, action and style of a file that is named as in HumanAct12; nothing of any other name.

    The style is the whole code, such as "0402", since fine actions have numbers alone in the release: with the action's
    name it is the fine label "jump/0402".

    Raises:
        InputError: such a name with a coarse action that HumanAct12 does not have.
    """
    found = _NAME.fullmatch(path.stem) if path.suffix == ".npy" else None
    if found is None:
        return Labels()
    person, coarse, fine = found.groups()
    if not 1 <= int(coarse) <= len(ACTIONS):
        raise InputError(path, f"A{coarse}{fine}", f"HumanAct12's actions are 01 to {len(ACTIONS)}")
    return Labels(f"P{person}", ACTIONS[int(coarse) - 1], f"{coarse}{fine}")
