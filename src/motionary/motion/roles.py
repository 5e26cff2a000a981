"""What the joints' names tell: roles (names are data, ``rigs.json``; roles are the SMPL joint names), sides, chains."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
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


def read_mapping(given: Path | str | Mapping[str, str], joints: tuple[str, ...]) -> dict[str, int]:
    """A user's own map from role to joint name (a JSON file or a dict), as indices.

    Raises:
        InputError: the file is unreadable, or a role or joint is unknown.
    """
    mapping = checked_mapping(given)
    for joint in mapping.values():
        if joint not in joints:
            raise InputError(_called(given), joint, "no joint of this name in the skeleton")
    return {role: joints.index(joint) for role, joint in mapping.items()}


def checked_mapping(given: Path | str | Mapping[str, str]) -> dict[str, str]:
    """Joint name by role, of a JSON file or a dict.

    Raises:
        InputError: the file is unreadable, a role is unknown, or two roles share a joint.
    """
    what, mapping = _called(given), given
    if not isinstance(given, Mapping):
        try:
            mapping = json.loads(Path(given).read_text("utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(what, error, "a JSON file with a joint name for each role") from None
    if not isinstance(mapping, Mapping):
        raise InputError(what, mapping, "an object with a joint name for each role")
    known, roles = _rigs()["smpl"], dict(mapping)
    for role, joint in roles.items():
        if role not in known:
            raise InputError(what, role, f"roles are {', '.join(sorted(known))}")
        if not isinstance(joint, str) or list(roles.values()).count(joint) > 1:
            raise InputError(f"{what}: {role}", joint, "must be the name of a joint that plays no other role")
    return roles


def _called(given: Path | str | Mapping[str, str]) -> str:
    """How complaints name a mapping."""
    return "mapping" if isinstance(given, Mapping) else str(given)


def chains_of(parents: Sequence[int]) -> tuple[tuple[int, ...], ...]:
    """Split the tree into chains: each goes on through the child with the longest way to a leaf."""
    children: list[list[int]] = [[] for _ in parents]
    depth = [0] * len(parents)
    for joint in range(len(parents) - 1, 0, -1):
        children[parents[joint]].append(joint)
        depth[parents[joint]] = max(depth[parents[joint]], depth[joint] + 1)
    chains = []
    starts = [(0, child) for child in reversed(children[0])]
    while starts:
        begin, joint = starts.pop(0)
        chain = [begin, joint]
        while children[joint]:
            onward = max(children[joint], key=lambda child: depth[child])
            starts += [(joint, child) for child in reversed(children[joint]) if child != onward]
            chain.append(onward)
            joint = onward
        chains.append(tuple(chain))
    return tuple(chains) or ((0,),)


def pairs_of(joints: Sequence[str], roles: Mapping[str, int]) -> tuple[tuple[int, int], ...]:
    """Pairs by role, and by name for what has no role (fingers, twist bones)."""
    pairs = {roles[r]: roles["right" + r[4:]] for r in roles if r.startswith("left") and "right" + r[4:] in roles}
    index = {name: i for i, name in enumerate(joints)}
    swaps = (("Left", "Right"), ("left", "right"), ("_L_", "_R_"), ("L", "R"), ("l", "r"))
    for left, i in index.items():
        for a, b in swaps:
            spots = (
                b + left[len(a) :] if left.startswith(a) else left,
                left[: -len(a)] + b if left.endswith(a) else left,
            )
            spots = (*spots, left.replace(a, b, 1)) if len(a) > 1 else spots
            right = next((s for s in spots if s != left and s in index), None)
            if right is not None and i not in pairs and index[right] not in pairs.values():
                pairs[i] = index[right]
    return tuple(sorted(pairs.items()))


@lru_cache
def _rigs() -> dict[str, dict[str, list[str]]]:
    return json.loads((files("motionary.motion") / "rigs.json").read_text("utf-8"))


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.rsplit(":", 1)[-1].lower())
