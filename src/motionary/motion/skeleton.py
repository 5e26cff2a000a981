"""Skeletons are data: joints, parents, rest offsets, chains, feet and left/right pairs."""

from __future__ import annotations

import json
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from importlib.resources import files
from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.motion.roles import chains_of, pairs_of, roles_of

NAMED = ("smpl22", "kit21")
MOST_JOINTS = 500
_LONGEST_NAME = 200


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A rooted tree of joints in its rest pose.

    The rest pose is T-pose-like, faces +z, y is up and the left side is at +x. Parents stand before their children.
    Two skeletons are equal when their contents are.

    Attributes:
        name: short name, for people.
        joints: (J,) unique joint names.
        parents: (J,) index of each joint's parent, -1 for the root, which is joint 0.
        offsets: (J, 3) rest offset of each joint from its parent, metres.
        chains: kinematic chains, joint indices; the first ones start at the root.
        pairs: (left, right) joint indices.
        feet: left ankle, left toe, right ankle, right toe.
        hips, shoulders: (left, right).
        directions: (J, 3) raw unit bone directions of the HumanML3D codec; None where they follow from the offsets.
        codec_swaps_sides: the HumanML3D codec takes this skeleton's left side for its right one. KIT-ML's released
            joints live in a mirrored world, so that its release lists the left joints where the right ones belong.

    Raises:
        InputError: a shape, an index or a value is wrong.
    """

    name: str
    joints: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: np.ndarray
    chains: tuple[tuple[int, ...], ...]
    pairs: tuple[tuple[int, int], ...]
    feet: tuple[int, int, int, int]
    hips: tuple[int, int]
    shoulders: tuple[int, int]
    directions: np.ndarray | None = field(default=None)
    codec_swaps_sides: bool = False

    def __post_init__(self):
        object.__setattr__(self, "joints", tuple(self.joints))
        for name in ("parents", "feet", "hips", "shoulders"):
            object.__setattr__(self, name, _indices(self.name, name, getattr(self, name)))
        for name in ("chains", "pairs"):
            rows = tuple(_indices(self.name, name, row) for row in getattr(self, name))
            object.__setattr__(self, name, rows)
        object.__setattr__(self, "offsets", _frozen_array(self.name, "offsets", self.offsets))
        if self.directions is not None:
            object.__setattr__(self, "directions", _frozen_array(self.name, "directions", self.directions))
        _check(self)

    @staticmethod
    def named(name: str) -> Skeleton:
        """A skeleton that comes with the package: ``smpl22`` (HumanML3D) or ``kit21`` (KIT-ML).

        Raises:
            InputError: no such skeleton.
        """
        if name not in NAMED:
            raise InputError("skeleton", name, f"one of {', '.join(NAMED)}")
        return _named(name)

    @staticmethod
    def from_rig(name: str, joints: Sequence[str], parents: Sequence[int], offsets: np.ndarray) -> Skeleton:
        """A skeleton from its tree: chains, pairs, feet, hips and shoulders follow from names, tree and rest offsets.

        Where a rig is unknown, feet, hips and shoulders point at the root: such a motion can be read, converted and
        drawn, but `retarget` refuses it, naming the roles it misses.

        Args:
            name: name of the new skeleton.
            joints: (J,) unique names.
            parents: (J,) parent indices, -1 for the root.
            offsets: (J, 3) rest offsets, metres.
        """
        roles = roles_of(tuple(joints), parents, offsets)

        def at(role: str, otherwise: int = 0) -> int:
            """Index of the joint in a role."""
            return roles.get(role, otherwise)

        left, right = at("left_ankle"), at("right_ankle")
        return Skeleton(
            name=name,
            joints=tuple(joints),
            parents=tuple(int(p) for p in parents),
            offsets=offsets,
            chains=chains_of(parents),
            pairs=pairs_of(joints, roles),
            # A rig without toes stands on its ankles.
            feet=(left, at("left_foot", left), right, at("right_foot", right)),
            hips=(at("left_hip"), at("right_hip")),
            shoulders=(at("left_shoulder"), at("right_shoulder")),
        )

    @cached_property
    def roles(self) -> dict[str, int]:
        """Joint index by role (``pelvis``, ``left_wrist``, ``head``, ...: the SMPL joint names), where known."""
        return roles_of(self.joints, self.parents, self.offsets)

    @cached_property
    def bone_lengths(self) -> np.ndarray:
        """(J,) length of the bone that ends in each joint, metres; 0 for the root."""
        return np.linalg.norm(self.offsets, axis=-1)

    @cached_property
    def rest(self) -> np.ndarray:
        """(J, 3) float64 joint positions of the rest pose, the root at the origin, metres."""
        rest = np.zeros((len(self), 3))
        for joint, parent in enumerate(self.parents[1:], 1):
            rest[joint] = rest[parent] + self.offsets[joint]
        rest.flags.writeable = False
        return rest

    @cached_property
    def codec_directions(self) -> np.ndarray:
        """(J, 3) unit bone directions that the HumanML3D codec rotates from: `directions`, or those of the offsets."""
        if self.directions is not None:
            return self.directions
        length = self.bone_lengths[:, None]
        up = np.array([0, 1, 0], np.float32)
        return np.where(length > 1e-6, self.offsets / np.maximum(length, 1e-6), up)

    def with_offsets(self, offsets: np.ndarray) -> Skeleton:
        """The same tree with other rest offsets (J, 3), metres."""
        return Skeleton(**{**_fields(self), "offsets": offsets})

    def to_json(self) -> dict[str, Any]:
        """Plain values for a JSON file; `from_json` reads them back exactly."""
        plain = _fields(self)
        plain["offsets"] = self.offsets.tolist()
        plain["directions"] = None if self.directions is None else self.directions.tolist()
        return {
            key: [list(v) if isinstance(v, tuple) else v for v in value] if isinstance(value, tuple) else value
            for key, value in plain.items()
        }

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> Skeleton:
        """The skeleton that `to_json` wrote.

        Raises:
            InputError: a key is missing or unknown, or its value is wrong.
        """
        known = set(Skeleton.__dataclass_fields__)
        if unknown := set(data) - known:
            raise InputError("skeleton", sorted(unknown), f"keys must be among {sorted(known)}")
        if missing := known - {"directions", "codec_swaps_sides"} - set(data):
            raise InputError("skeleton", sorted(missing), "these keys are missing")
        return Skeleton(**data)

    def __len__(self) -> int:
        return len(self.joints)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Skeleton) and self._content == other._content

    def __hash__(self) -> int:
        return hash(self._content)

    @cached_property
    def _content(self) -> tuple:
        plain = _fields(self)
        directions = None if self.directions is None else self.directions.tobytes()
        return tuple({**plain, "offsets": self.offsets.tobytes(), "directions": directions}.values())


@lru_cache
def _named(name: str) -> Skeleton:
    return Skeleton.from_json(json.loads((files("motionary.motion") / "skeletons" / f"{name}.json").read_text("utf-8")))


def _fields(skeleton: Skeleton) -> dict[str, Any]:
    return {name: getattr(skeleton, name) for name in Skeleton.__dataclass_fields__}


def _frozen_array(skeleton: str, name: str, values: Any) -> np.ndarray:
    try:
        array = np.array(values, dtype=np.float32) + np.float32(0)  # no -0, which would compare as different
    except (TypeError, ValueError):
        raise InputError(f"skeleton {skeleton}.{name}", values, "numbers of shape (J, 3)") from None
    array.flags.writeable = False
    return array


def _indices(skeleton: str, name: str, values: Any) -> tuple[int, ...]:
    try:
        return tuple(operator.index(v) for v in values)
    except TypeError:
        raise InputError(f"skeleton {skeleton}.{name}", values, "a list of joint indices") from None


def _writable(name: str) -> bool:
    """Whether a file can hold the name: half of a surrogate pair is no text."""
    return not any("\ud800" <= character <= "\udfff" for character in name)


def _check(skeleton: Skeleton) -> None:
    for name in (skeleton.name, *skeleton.joints):
        if not isinstance(name, str) or len(name) > _LONGEST_NAME or not _writable(name):
            rule = f"names must be Unicode text of at most {_LONGEST_NAME} characters"
            raise InputError("skeleton", repr(name), rule)
    what, count = f"skeleton {skeleton.name}", len(skeleton.joints)
    if count > MOST_JOINTS:
        raise InputError(what, f"{count} joints", f"must have at most {MOST_JOINTS}")
    if count < 1 or len(set(skeleton.joints)) != count:
        raise InputError(what, skeleton.joints, "joint names must be unique, at least one")
    ordered = len(skeleton.parents) == count and skeleton.parents[0] == -1
    if not ordered or any(not 0 <= p < j for j, p in enumerate(skeleton.parents) if j):
        raise InputError(
            what, skeleton.parents, "parents: one per joint, -1 for the root alone, parents before children"
        )
    for name in ("offsets", "directions"):
        array = getattr(skeleton, name)
        if array is not None and (array.shape != (count, 3) or not np.isfinite(array).all()):
            raise InputError(f"{what}.{name}", array.shape, f"finite values of shape ({count}, 3)")
    for name, length in (("feet", 4), ("hips", 2), ("shoulders", 2)):
        if len(getattr(skeleton, name)) != length:
            raise InputError(f"{what}.{name}", getattr(skeleton, name), f"{length} joint indices")
    groups = (*skeleton.chains, *skeleton.pairs, skeleton.feet, skeleton.hips, skeleton.shoulders)
    if any(not 0 <= j < count for group in groups for j in group):
        raise InputError(what, groups, f"joint indices from 0 to {count - 1}")
