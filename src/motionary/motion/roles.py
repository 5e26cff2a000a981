"""Who plays which role on a rig: by names, by the tree, by the user's own map; and sides and chains."""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.files import readable
from motionary.motion.rigs import CENTRAL, REQUIRED, ROLES, SIDES, find_roles
from motionary.motion.tree import common_ancestor, roles_by_tree
from motionary.text_files import read_text

# Keys that a mapping file may hold beside roles: how its motions are to be read.
READING_KEYS = ("up", "unit", "mirror", "skip_first", "body")
_LIMBS = (("pelvis", "hip", "knee", "ankle", "foot"), ("collar", "shoulder", "elbow", "wrist"))
_SPINE = ("spine1", "spine2", "spine3")
_MOST_SAID = 3
_LONGEST_FILE = 4_000_000  # bytes of a mapping


def roles_of(
    joints: tuple[str, ...], parents: Sequence[int], offsets: np.ndarray, poses: np.ndarray | None = None
) -> dict[str, int]:
    """Joint index by role: by the names of known rigs where those tell every required role, else by the tree.

    The trunk's upper end, spine3, is where the arms leave, whatever its name.

    Args:
        joints, parents, offsets: the rig, in any unit and axes.
        poses: (T, J, 3) joint positions, from which the tree tells left from right where its rest pose does not.
    """
    parents = tuple(int(p) for p in parents)
    offsets = np.asarray(offsets, np.float32)
    if poses is None:
        return dict(_roles_of(tuple(joints), parents, offsets.tobytes()))
    return dict(_roles_of(tuple(joints), parents, offsets.tobytes())) or roles_by_tree(joints, parents, offsets, poses)


@lru_cache(maxsize=256)
def _roles_of(joints: tuple[str, ...], parents: tuple[int, ...], offsets: bytes) -> dict[str, int]:
    named = dict(find_roles(joints))
    if not all(role in named for role in REQUIRED):
        # Some names may be known by chance: a part of the roles counts only where the tree has no answer.
        rest = np.frombuffer(offsets, np.float32).reshape(-1, 3)
        return roles_by_tree(joints, parents, rest) or named
    top = common_ancestor(parents, named["left_shoulder"], named["right_shoulder"])
    if top not in named.values():
        named["spine3"] = top
    return named


def contradictions(roles: Mapping[str, int], joints: Sequence[str], parents: Sequence[int]) -> list[str]:
    """What the tree says against roles, a line each: limbs out of order, or a left limb with a right one's joints."""

    def below(joint: int, other: int) -> bool:
        """Whether a joint hangs, however deep, on another."""
        while joint >= 0:
            joint = parents[joint]
            if joint == other:
                return True
        return False

    found = []
    sided = [[name if name == "pelvis" else f"{side}_{name}" for name in limb] for side in SIDES for limb in _LIMBS]
    for chain in [*sided, CENTRAL]:
        for upper, lower in itertools.pairwise(role for role in chain if role in roles):
            # Some rigs hang the legs or the spine beside the pelvis, none hangs a knee beside or above its hip.
            if not below(roles[lower], roles[upper]) and (upper != "pelvis" or below(roles[upper], roles[lower])):
                found.append(f"{joints[roles[lower]]} ({lower}) is not below {joints[roles[upper]]} ({upper})")
    return found


def disagreements(given: Mapping[str, int], known: Mapping[str, int], joints: Sequence[str]) -> list[str]:
    """Where a mapping gives a joint another role than names and tree do, a line each; rigs count the joints of the
    spine in many ways, so that these are left to the mapping."""
    by_joint = {joint: role for role, joint in known.items() if role not in _SPINE}
    other = {role: by_joint[joint] for role, joint in given.items() if by_joint.get(joint, role) != role}
    other = {role: seen for role, seen in other.items() if role not in _SPINE}
    sided = [role for role in given if role[:5] in ("left_", "right") and role in known]
    if len(sided) > 2 and all(other.get(role) == _across(role) for role in sided):
        return ["left and right of the mapping are the other way round by the joints' names and tree"]
    lines = [f"{joints[given[role]]} ({role}) is {seen} by the joints' names and tree" for role, seen in other.items()]
    return lines[:_MOST_SAID] + ([f"and {len(lines) - _MOST_SAID} more"] if len(lines) > _MOST_SAID else [])


def _across(role: str) -> str:
    """The same role on the other side."""
    return f"right{role[4:]}" if role.startswith("left") else f"left{role[5:]}"


def names_by_role(joints: Sequence[str], known: Mapping[str, int], given: Mapping[str, int]) -> list[str]:
    """The joints' names, where a joint that plays a role is named after it: by `given` roles first, then by `known`."""
    roles = {role: joint for role, joint in known.items() if joint not in given.values()} | dict(given)
    # A joint without a role may bear the name of one.
    names = [f"{joint} (other)" if joint in roles else joint for joint in joints]
    for role, joint in roles.items():
        names[joint] = role
    return names


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
    """Joint name by role, of a JSON file or a dict; keys that say how to read (`READING_KEYS`) are left out.

    Raises:
        InputError: the file is unreadable, a role is unknown, or two roles share a joint.
    """
    what = _called(given)
    roles = {role: joint for role, joint in load_mapping(given).items() if role not in READING_KEYS}
    for role, joint in roles.items():
        if role not in ROLES:
            raise InputError(what, role, f"roles are {', '.join(sorted(ROLES))}; also {', '.join(READING_KEYS)}")
        if not isinstance(joint, str) or list(roles.values()).count(joint) > 1:
            raise InputError(f"{what}: {role}", joint, "must be the name of a joint that plays no other role")
    return roles


def load_mapping(given: Path | str | Mapping[str, Any]) -> Mapping[str, Any]:
    """The object of a mapping file (JSON, in any encoding that `decoded` knows), or the dict itself.

    Raises:
        InputError: the file is unreadable or holds no object.
    """
    if isinstance(given, Mapping):
        return given
    try:
        if (size := readable(given).stat().st_size) > _LONGEST_FILE:
            raise InputError(given, f"{size:,} bytes", f"a mapping may have {_LONGEST_FILE:,}")
        mapping = json.loads(read_text(given))
    except InputError as error:
        raise InputError(given, error.value, f"{error.rule}; a JSON file with a joint name for each role") from None
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(given, error, "a JSON file with a joint name for each role") from None
    if not isinstance(mapping, Mapping):
        raise InputError(given, mapping, "an object with a joint name for each role")
    return mapping


class FileMapping(dict[str, str]):
    """Joint name by role, with the file that it was read from, which error messages name."""

    where = "mapping"


def _called(given: Path | str | Mapping[str, str]) -> str:
    """How error messages name a mapping."""
    return getattr(given, "where", "mapping") if isinstance(given, Mapping) else str(given)


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
