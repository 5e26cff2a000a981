"""Which joint of which rig plays which role: names are data (``rigs.json``), roles are the SMPL joint names."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import files
from pathlib import Path

from motionary.errors import InputError

REQUIRED = tuple(
    ["pelvis"]
    + [
        f"{side}_{joint}"
        for joint in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
        for side in ("left", "right")
    ]
)


@lru_cache
def find_roles(joints: tuple[str, ...]) -> dict[str, int]:
    """Joint index by role, by the rig of ``rigs.json`` that explains most of the names.

    Args:
        joints: joint names; namespaces (``mixamorig:Hips``), case and punctuation do not matter.
    """
    index: dict[str, int] = {}
    for i, joint in enumerate(joints):
        index.setdefault(_plain(joint), i)
    best: dict[str, int] = {}
    for rig in _rigs().values():
        found = {}
        for role, names in rig.items():
            spot = next((index[name] for name in map(_plain, names) if name in index), None)
            if spot is not None:
                found[role] = spot
        if len(found) > len(best):
            best = found
    return best


def read_mapping(path: Path | str | Mapping[str, str], joints: tuple[str, ...]) -> dict[str, int]:
    """A user's own map from role to joint name (a JSON file or a dict), as indices.

    Raises:
        InputError: the file is unreadable, or a role or joint is unknown.
    """
    if isinstance(path, Mapping):
        mapping, what = dict(path), "mapping"
    else:
        what = str(path)
        try:
            mapping = json.loads(Path(path).read_text("utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(what, error, "a JSON file with a joint name for each role") from None
    if not isinstance(mapping, dict):
        raise InputError(what, mapping, "an object with a joint name for each role")
    known = set(_rigs()["smpl"])
    for role, joint in mapping.items():
        if role not in known:
            raise InputError(what, role, f"roles are {', '.join(sorted(known))}")
        if joint not in joints:
            raise InputError(what, joint, "no joint of this name in the skeleton")
    return {role: joints.index(joint) for role, joint in mapping.items()}


@lru_cache
def _rigs() -> dict[str, dict[str, list[str]]]:
    return json.loads((files("motionary.motion") / "rigs.json").read_text("utf-8"))


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.rsplit(":", 1)[-1].lower())
