"""What the joints' names tell: the roles of known rigs (names are data, ``rigs.json``; roles are the SMPL joint names).

A rig of ``rigs.json`` lists the names that its programs use for each joint, with ``*`` in place of the side.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator
from functools import lru_cache
from importlib.resources import files

CENTRAL = ("pelvis", "spine1", "spine2", "spine3", "neck", "head")
LIMBS = ("hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist")
SIDES = ("left", "right")
ROLES = (*CENTRAL, *(f"{side}_{part}" for part in LIMBS for side in SIDES))
REQUIRED = (
    "pelvis",
    *(f"{side}_{part}" for part in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist") for side in SIDES),
)
_SHARED = 0.7  # an affix on more of the joints than this says whose rig it is, not which joint


@lru_cache
def find_roles(joints: tuple[str, ...]) -> dict[str, int]:
    """Joint index by role, by the rig of ``rigs.json`` that explains most of the names.

    Args:
        joints: joint names; namespaces (``mixamorig:Hips``), prefixes and suffixes that most joints share
            (``Character1_``, ``Bip01 ``, ``_JNT``), case and punctuation do not matter.
    """
    index: dict[str, int] = {}
    for i, joint in enumerate(joints):
        index.setdefault(_plain(joint), i)
    for i, joint in enumerate(_without_affixes(joints)):
        index.setdefault(_plain(joint), i)
    index.pop("", None)
    best: dict[str, int] = {}
    most = (0, 0)
    for rig in _rigs().values():
        found = {}
        for role, names in rig.items():
            spot = next((index[name] for name in names if name in index), None)
            if spot is not None:
                found[role] = spot
        explained = (sum(role in found for role in REQUIRED), len(found))
        if explained > most:
            best, most = found, explained
    return best


def sides_of(joints: tuple[str, ...]) -> list[str]:
    """ "left", "right" or "" for each joint, by the letter or the word in its name."""
    found = []
    for name in joints:
        words = [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)]
        left = bool({"l", "left", "lft", "lt"} & set(words)) or "左" in name
        right = bool({"r", "right", "rgt", "rt"} & set(words)) or "右" in name
        found.append("" if left == right else "left" if left else "right")
    return found


def _without_affixes(joints: tuple[str, ...]) -> list[str]:
    """The names without namespaces, and without the words that most of them begin or end with."""
    names = [joint.rsplit(":", 1)[-1].rsplit("|", 1)[-1] for joint in joints]
    for pattern in (r"^[^\W_]+[\W_]+", r"[\W_]+[^\W_]+$"):
        while len(names) > 3:
            affixes = Counter(match[0] for name in names if (match := re.search(pattern, name)))
            affix, count = affixes.most_common(1)[0] if affixes else ("", 0)
            if count <= _SHARED * len(names):
                break
            names = [re.sub(pattern, "", n) if (m := re.search(pattern, n)) and m[0] == affix else n for n in names]
    return names


@lru_cache
def _rigs() -> dict[str, dict[str, list[str]]]:
    """Plain names by role, by rig."""
    listed = json.loads((files("motionary.motion") / "rigs.json").read_text("utf-8"))
    return {name: dict(_spelled(rig)) for name, rig in listed.items()}


def _spelled(rig: dict[str, list]) -> Iterator[tuple[str, list[str]]]:
    for part in CENTRAL:
        if part in rig:
            yield part, [_plain(name) for name in rig[part]]
    for part in LIMBS:
        for i, side in enumerate(SIDES):
            if part in rig:
                yield (
                    f"{side}_{part}",
                    [_plain(name.replace("*", pair[i])) for name in rig[part] for pair in rig["sides"]],
                )


def _plain(name: str) -> str:
    return re.sub(r"[\W_]", "", name.rsplit(":", 1)[-1].lower())
