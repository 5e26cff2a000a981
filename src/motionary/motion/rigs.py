"""What the joints' names tell: the roles of known rigs (names are data, ``rigs.json``; roles are the SMPL joint names).

``rigs.json`` lists what programs call the joints of trunk, legs and arms, sides left out. Programs mix these freely,
but one name means different joints: beside a `LeftUpLeg`, `LeftLeg` is the shin, beside a `LeftKnee` it is the thigh.
So a trunk, a pair of legs or of arms is known as a whole, by the row that explains most (the first of equal ones).
"""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Collection, Container, Iterator, Mapping
from functools import lru_cache
from importlib.resources import files
from itertools import chain, islice

SPINE = ("spine1", "spine2", "spine3", "neck")
CENTRAL = ("pelvis", *SPINE, "head")
LIMBS = ("hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist")
SIDES = ("left", "right")
ROLES = (*CENTRAL, *(f"{side}_{part}" for part in LIMBS for side in SIDES))
REQUIRED = (
    "pelvis",
    *(f"{side}_{part}" for part in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist") for side in SIDES),
)
_WAYS = tuple(  # how names say left and right: the words, and whether they stand before the rest
    (words, before)
    for words in (("left", "right"), ("l", "r"), ("lt", "rt"), ("lf", "rt"), ("lft", "rgt"), ("左", "右"))
    for before in (True, False)
)
_OFTEN_OTHERS = ("root", "spine")  # the pelvis only of rigs of which the lowest joint of the spine is found too
_TRIED = 8  # readings of the names: those with the most known ones
_LETTERS = 200  # of a name, at its end: longer ones take time and say no more
_LONGEST = 6  # parts of a known name, as `left`, `foot`, `ankle`
_PARTS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+|[^\W\d_A-Za-z]+")


@lru_cache
def find_roles(joints: tuple[str, ...]) -> dict[str, int]:
    """Joint index by role, by the rows of ``rigs.json`` that explain most of the names; no joint has two roles.

    Args:
        joints: joint names; namespaces (``mixamorig:Hips``), what many names begin or end with (``Character1_``,
            ``Bip01 ``, ``mixamorig``, ``_JNT``), numbers at their ends (``Hips_01``), case and punctuation do not
            matter. Left and right are told by words or letters before or after the rest.
    """
    readings = _readings(joints)
    best: dict[str, int] = {}
    # Names without the affix count only where those with it do not suffice: Rigify's `hips` moves none of `DEF-spine`.
    for mixed in (False, True):
        for (_, _, way), index in islice(readings.items(), _TRIED):
            found = _explained({**readings.get(("", "", way), {}), **index} if mixed else index)
            if (_required(found), len(found)) > (_required(best), len(best)):
                best = found
        if _required(best) == len(REQUIRED):
            break
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


def _readings(joints: tuple[str, ...]) -> dict[tuple[str, str, int], dict[str, int]]:
    """Joint index by known name, by what stands before and after it and by the way to say sides; the fullest first."""
    known = _known_names()
    found: defaultdict[tuple[str, str, int], dict[str, int]] = defaultdict(dict)
    for i, joint in enumerate(joints):
        for prefix, name, suffix in _cuts(re.split(r"[:|]", joint)[-1][-_LETTERS:], known):
            for way, key in known[name]:
                found[prefix, suffix, way].setdefault(key, i)
    return dict(sorted(found.items(), key=lambda item: (-len(item[1]), len(item[0][0]) + len(item[0][1]))))


def _cuts(name: str, known: Container[str]) -> Iterator[tuple[str, str, str]]:
    """Every way to cut a name into a prefix, a known name, and a suffix whose numbers do not count."""
    parts = list(_PARTS.finditer(name))
    words = [part[0].lower() for part in parts]
    for i, first in enumerate(parts):
        if 0 < first.start() < 3 and name[first.start() - 1].isalnum():
            continue  # letters as in `lShin` and `mHead`: no prefix of a program
        for j in range(i, min(i + _LONGEST, len(parts))):
            if (word := "".join(words[i : j + 1])) in known:
                yield name[: first.start()], word, re.sub(r"\d+", "#", name[parts[j].end() :])


def _explained(index: Mapping[str, int]) -> dict[str, int]:
    """Joint index by role: of trunks, legs and arms the row that explains most each, required roles counting twice."""
    found: dict[str, int] = {}
    for rows in _rigs().values():
        fitting = [_fitting(row, index, found.values()) for row in rows]
        found |= max(fitting, key=lambda fits: len(fits) + _required(fits))
    return found


def _fitting(row: Mapping[str, list[str]], index: Mapping[str, int], taken: Collection[int]) -> dict[str, int]:
    """Joint index by role of one row, without joints that are taken."""
    found: dict[str, int] = {}
    for role, names in row.items():
        free = (name for name in names if name in index and index[name] not in (*taken, *found.values()))
        if (name := next(free, None)) is not None:
            found[role] = index[name]
    lowest = next((role for role in row if role.startswith("spine")), "pelvis")
    doubted = found.get("pelvis") in [index.get(name, -1) for name in _OFTEN_OTHERS]
    return {} if doubted and lowest not in found else found


def _required(found: Mapping[str, int]) -> int:
    return sum(role in found for role in REQUIRED)


@lru_cache
def _rigs() -> dict[str, list[dict[str, list[str]]]]:
    """Plain names by role, `left upleg` where they have a side: the rows of trunks, legs and arms."""
    listed = json.loads((files("motionary.motion") / "rigs.json").read_text("utf-8"))
    return {
        kind: [
            {
                f"{side}_{part}" if side else part: [f"{side} {_plain(name)}".strip() for name in names]
                for part, names in row.items()
                for side in (SIDES if part in LIMBS else ("",))
            }
            for row in rows.values()
        ]
        for kind, rows in listed.items()
    }


@lru_cache
def _known_names() -> dict[str, list[tuple[int, str]]]:
    """What joints may be called: the way to say sides, and the name in `_rigs`."""
    found: defaultdict[str, list[tuple[int, str]]] = defaultdict(list)
    # In the order of the file: of readings that say equally much the first is taken.
    listed = (names for rows in _rigs().values() for row in rows for names in row.values())
    for key in dict.fromkeys(chain.from_iterable(listed)):
        side, _, name = key.rpartition(" ")
        for way, (words, before) in enumerate(_WAYS):
            if side:
                word = words[SIDES.index(side)]
                found[word + name if before else name + word].append((way, key))
            else:  # some rigs have a letter for the centre
                found[name].append((way, key))
                found[f"c{name}"].append((way, key))
    return dict(found)


def _plain(name: str) -> str:
    return re.sub(r"[\W_]", "", name.lower())
