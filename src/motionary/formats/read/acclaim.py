"""Acclaim motion capture: a skeleton (ASF) and its motion (AMC), as the CMU and HDM05 databases give them.

Reference: the ASF/AMC format notes of Acclaim Advanced Technologies. A bone's rotation relative to its parent is
C M C^-1, where M is made of its degrees of freedom and C is its axis; a bone starts where its parent ends, after the
parent's direction times length.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.files import read_text
from motionary.formats.read.extent import check_extent
from motionary.formats.read.reading_options import Reading, ReadingOptions
from motionary.formats.tracks import Track, to_motion
from motionary.motion import Motion
from motionary.motion.rotations import euler_to_unitquat, quat_conjugation, quat_product
from motionary.motion.skeleton import MOST_JOINTS

_CMU_FPS = 120.0  # AMC files state no rate
_TURNS, _MOVES = {"rx": 0, "ry": 1, "rz": 2}, {"tx": 0, "ty": 1, "tz": 2}


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


def read_amc(
    path: str | os.PathLike, asf: str | os.PathLike | None = None, fps: float = _CMU_FPS, **options: Any
) -> Motion:
    """The motion of `amc_with`; options are those of `ReadingOptions`."""
    return amc_with(path, ReadingOptions(**options), asf, fps)[0]


def amc_with(
    path: str | os.PathLike,
    options: ReadingOptions | None = None,
    asf: str | os.PathLike | None = None,
    fps: float = _CMU_FPS,
) -> tuple[Motion, Reading]:
    """Read an AMC file with the skeleton of its ASF file; and how it was read.

    Joints carry the names of the bones that start in them; where a chain ends, ``<bone>_end`` follows.

    Args:
        path: the .amc file.
        options: what the user knows of the file; without a unit it is 0.0254 / 0.45 m where the ASF's length unit is
            0.45 (CMU), else measured.
        asf: the .asf file; None takes ``<stem>.asf``, ``<subject>.asf`` (02_01.amc: 02.asf) or the folder's only one.
        fps: frames per second, 120 at CMU; the file does not say.

    Raises:
        InputError: a missing ASF, an unknown bone, a wrong count or value: file, line and rule.
    """
    path, options = Path(path), options or ReadingOptions()
    text = read_text(path)
    rig_path = _find_asf(path) if asf is None else Path(asf)
    rig = parse_asf(read_text(rig_path), rig_path)
    values, degrees = _parse_amc(text, rig, path)
    frames = max(map(len, values.values()), default=1)
    joints = 2 * len(rig.bones)  # with the ends of chains
    check_extent(path, f"{frames:,} frames of {len(rig.bones)} bones", frames * joints, len(text))
    track = _track(rig, values, degrees)
    if abs(rig.length - 0.45) < 1e-6:
        options = options.over(ReadingOptions(unit="cmu"))
    return to_motion(track, fps, path, options)


def _find_asf(path: Path) -> Path:
    for name in (path.stem, path.stem.split("_")[0]):
        for extension in (".asf", ".ASF"):
            if (found := path.with_name(name + extension)).exists():
                return found
    found = sorted(path.parent.glob("*.[aA][sS][fF]"))
    if len(found) != 1:
        raise InputError(path, f"{len(found)} .asf files beside it", f"its skeleton {path.stem}.asf is needed (asf=)")
    return found[0]


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
        if unknown := [word for word in root.dof if word not in _TURNS | _MOVES]:
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
        if unknown := [word for word in bone.dof if word not in _TURNS]:
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


def _parse_amc(text: str, rig: AcclaimRig, name: object) -> tuple[dict[str, np.ndarray], bool]:
    """Each moving bone's values (T, its dof), and whether angles are degrees."""
    moving = [bone.name for bone in rig.bones.values() if bone.dof]
    frames: list[dict[str, list[float]]] = []
    degrees, frame_line = rig.degrees, 0
    for i, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        if words[0].startswith(":"):
            degrees = {":degrees": True, ":radians": False}.get(words[0].lower(), degrees)
        elif len(words) == 1 and words[0].isdigit():
            _complete(frames, moving, name, frame_line)
            frames.append({})
            frame_line = i
        else:
            _amc_line(frames, rig, words, f"{name}, line {i}")
    if not frames:
        raise InputError(name, "no frames", "an AMC file must hold numbered frames")
    _complete(frames, moving, name, frame_line)
    values = {bone: np.array([frame[bone] for frame in frames]) for bone in moving}
    for bone, array in values.items():
        if not np.isfinite(array).all():
            at = int(np.argwhere(~np.isfinite(array))[0, 0])
            raise InputError(name, f"frame {at + 1}, bone {bone}", "values must be finite")
    return values, degrees


def _amc_line(frames: list[dict[str, list[float]]], rig: AcclaimRig, words: list[str], where: str) -> None:
    bone = rig.bones.get(words[0])
    if bone is None or not frames:
        raise InputError(where, words[0], "must be a bone of the ASF file" if frames else "a frame number comes first")
    if len(words) - 1 != len(bone.dof):
        raise InputError(where, " ".join(words), f"{bone.name} has {len(bone.dof)} degrees of freedom")
    try:
        frames[-1][bone.name] = [float(word) for word in words[1:]]
    except ValueError:
        raise InputError(where, " ".join(words), "values must be numbers") from None


def _complete(frames: list[dict[str, list[float]]], moving: list[str], name: object, line: int) -> None:
    if frames and (missing := [bone for bone in moving if bone not in frames[-1]]):
        raise InputError(f"{name}, line {line}", ", ".join(missing), f"frame {len(frames)} lacks these (truncated?)")


def _track(rig: AcclaimRig, values: dict[str, np.ndarray], degrees: bool) -> Track:
    frames = len(next(iter(values.values()))) if values else 1
    names = ["root"]
    for name in names:  # grows while it runs: parents before children
        names += [child for child, parent in rig.parents.items() if parent == name]
    joints, parents = list(names), [names.index(rig.parents[n]) if n in rig.parents else -1 for n in names]
    for name in names:
        if name not in rig.parents.values() and np.any(rig.bones[name].vector):
            joints.append(f"{name}_end")
            parents.append(names.index(name))
    rotations = np.zeros((frames, len(joints), 4))
    rotations[..., 3] = 1
    translations = np.zeros((frames, len(joints), 3))
    translations[:, 0] = rig.position
    for j, name in enumerate(joints):
        if j:
            translations[:, j] = rig.bones[names[parents[j]]].vector
        if name not in values:
            continue
        bone = rig.bones[name]
        turns = [c for c, dof in enumerate(bone.dof) if dof in _TURNS][::-1]  # the first one turns first
        angles = values[name][:, turns]
        local = euler_to_unitquat([_TURNS[bone.dof[c]] for c in turns], np.radians(angles) if degrees else angles)
        axis = np.broadcast_to(bone.axis, local.shape)
        rotations[:, j] = quat_product(quat_product(axis, local), quat_conjugation(axis))
        for c, dof in enumerate(bone.dof):
            if dof in _MOVES:
                translations[:, j, _MOVES[dof]] += values[name][:, c]
    return Track(tuple(joints), tuple(parents), rotations, translations)
