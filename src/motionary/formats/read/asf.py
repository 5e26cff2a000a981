"""The skeleton of Acclaim motion capture (ASF): bones by direction and length, in a hierarchy."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from motionary.errors import InputError
from motionary.motion.rotations import euler_to_unitquat
from motionary.motion.skeleton import MOST_JOINTS

TURNS, MOVES = {"rx": 0, "ry": 1, "rz": 2}, {"tx": 0, "ty": 1, "tz": 2}  # channels, and the axis of each


@dataclass
class Bone:
    """One bone of an ASF file; the joint of the same name stands at its start."""

    name: str
    direction: np.ndarray = field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    axis: np.ndarray = field(default_factory=lambda: np.array([0.0, 0, 0, 1]))  # the quaternion C
    dof: list[str] = field(default_factory=list)

    @property
    def vector(self) -> np.ndarray:
        """From its start to its end, at rest."""
        return self.direction / max(np.linalg.norm(self.direction), 1e-9) * self.length


@dataclass
class AcclaimRig:
    """An ASF file: bones by name (root first), each bone's parent, the length unit and whether angles are degrees."""

    bones: dict[str, Bone]
    parents: dict[str, str]
    length: float
    degrees: bool
    position: np.ndarray


def parse_asf(text: str, name: object) -> AcclaimRig:
    """Parse an ASF file (see `AcclaimRig`).

    Raises:
        InputError: file, line and rule.
    """
    rig = AcclaimRig({"root": Bone("root")}, {}, 1.0, True, np.zeros(3))
    section, bone = "", None
    for i, line in enumerate(text.splitlines(), 1):
        words = line.split("#")[0].split()
        if not words:
            continue
        try:
            if words[0].startswith(":"):
                section = words[0].lower()
            elif section == ":units":
                _unit(rig, words)
            elif section == ":root":
                _root(rig, words)
            elif section == ":bonedata":
                bone = _bone_line(rig, bone, words)
            elif section == ":hierarchy" and words[0] not in ("begin", "end"):
                _family(rig, words)
        except (ValueError, IndexError) as error:
            if isinstance(error, InputError):
                raise InputError(f"{name}, line {i}", error.value, error.rule) from None
            raise InputError(f"{name}, line {i}", line.strip(), "is not a valid line of an ASF file") from None
    lost = [bone for bone in rig.bones if bone != "root" and bone not in rig.parents]
    if lost or len(rig.bones) < 2:
        raise InputError(name, ", ".join(lost) or "no bones", "every bone must stand in the hierarchy, at least one")
    return rig


def _unit(rig: AcclaimRig, words: list[str]) -> None:
    if words[0] == "length":
        rig.length = float(_numbers(words[1:2], 1)[0])
        if rig.length <= 0:
            raise InputError("length", words[1], "must be above 0")
    elif words[0] == "angle":
        rig.degrees = words[1].lower().startswith("deg")


def _root(rig: AcclaimRig, words: list[str]) -> None:
    root = rig.bones["root"]
    if words[0] == "order":
        root.dof = [word.lower() for word in words[1:]]
        if unknown := [word for word in root.dof if word not in TURNS | MOVES]:
            raise InputError("order", " ".join(unknown), "the root's order must name TX TY TZ RX RY RZ")
        _once("order", root.dof)
    elif words[0] == "position":
        rig.position = _numbers(words[1:4], 3)
    elif words[0] == "orientation":
        root.axis = _rotation([*words[1:4], "XYZ"], rig.degrees)


def _bone_line(rig: AcclaimRig, bone: Bone | None, words: list[str]) -> Bone | None:
    key, rest = words[0], words[1:]
    if key == "begin":
        return Bone("")
    if bone is None:
        raise InputError("bonedata", key, "a bone starts with 'begin'")
    if key == "end":
        if not bone.name:
            raise InputError("bone", "no name", "every bone needs a name")
        rig.bones[bone.name] = bone
        return None
    if key == "name":
        bone.name = rest[0]
        if bone.name in rig.bones:
            raise InputError("bone", bone.name, "bone names must be unique")
        if len(rig.bones) >= MOST_JOINTS:
            raise InputError("bone", bone.name, f"at most {MOST_JOINTS} bones")
    elif key == "direction":
        bone.direction = _numbers(rest, 3)
    elif key == "length":
        bone.length = float(_numbers(rest, 1)[0])
    elif key == "axis":
        bone.axis = _rotation(rest, rig.degrees)
    elif key == "dof":
        bone.dof = [word.lower() for word in rest]
        if unknown := [word for word in bone.dof if word not in TURNS]:
            raise InputError("dof", " ".join(unknown), "only rx, ry and rz are supported on bones")
        _once("dof", bone.dof)
    return bone


def _once(what: str, names: list[str]) -> None:
    if len(set(names)) < len(names):
        raise InputError(what, " ".join(names), "must name each channel once")


def _family(rig: AcclaimRig, words: list[str]) -> None:
    for name in words:
        if name not in rig.bones:
            raise InputError("hierarchy", name, "names no bone of this file")
    for child in words[1:]:
        above = words[0]
        while above in rig.parents and above != child:
            above = rig.parents[above]
        if child in rig.parents or above == child or child == "root":
            raise InputError("hierarchy", child, "a bone has one parent, and is not its own ancestor")
        rig.parents[child] = words[0]


def _numbers(words: list[str], count: int) -> np.ndarray:
    numbers = np.array([float(word) for word in words])
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise InputError("values", " ".join(words), f"must be {count} finite number{'s' * (count > 1)}")
    return numbers


def _rotation(words: list[str], degrees: bool) -> np.ndarray:
    """The quaternion of three angles and an order such as XYZ, of which the first letter turns first."""
    angles = _numbers(words[:3], 3)
    order = [" xyz".index(letter) - 1 for letter in words[3].lower()]
    if sorted(order) != [0, 1, 2]:
        raise InputError("axis", words[3], "must be an order of X, Y and Z")
    return euler_to_unitquat(order[::-1], (np.radians(angles) if degrees else angles)[order[::-1]])
