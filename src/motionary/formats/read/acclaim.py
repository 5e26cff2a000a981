"""Acclaim motion capture: a motion (AMC) and its skeleton (:mod:`asf`), as the CMU and HDM05 databases give them.

Reference: the ASF/AMC format notes of Acclaim Advanced Technologies. A bone's rotation relative to its parent is
C M C^-1, where M is made of its degrees of freedom and C is its axis; a bone starts where its parent ends, after the
parent's direction times length.
"""

from __future__ import annotations

import os
from array import array
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from motionary.errors import InputError
from motionary.files import readable
from motionary.formats.animated_rig import Track, stretches
from motionary.formats.number_rows import LONGEST_LINE, Told, reading_bar, text_end, text_lines
from motionary.formats.read.asf import MOVES, TURNS, AcclaimRig, parse_asf
from motionary.formats.read.extent import check_extent
from motionary.formats.read.reading_options import Reading, ReadingOptions
from motionary.formats.tracks import to_motion
from motionary.motion import Motion
from motionary.motion.rotations import euler_to_unitquat, quat_conjugation, quat_product
from motionary.text_files import decoded, read_text, text_stream

_CMU_FPS = 120.0  # AMC files state no rate


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
    path, options = readable(path), options or ReadingOptions()
    rig_path = _find_asf(path) if asf is None else Path(asf)
    rig = parse_asf(read_text(rig_path), rig_path)
    with text_stream(path) as file, reading_bar(file, path, options.progress) as told:
        end = text_end(file, path)
        file.seek(0)
        values, degrees, frames = _parse_amc(_lines(file, end, path, told), rig, path)
    joints = 2 * len(rig.bones)  # with the ends of chains
    check_extent(path, f"{frames:,} frames of {len(rig.bones)} bones", frames * joints, end)
    track = _track(rig, values, degrees, frames)
    del values
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


def _lines(file: BinaryIO, end: int, name: object, told: Told) -> Iterator[str]:
    for i, line in enumerate(text_lines(file, end), 1):
        if len(line) > LONGEST_LINE:
            raise InputError(f"{name}, line {i}", f"more than {LONGEST_LINE:,} bytes", "must be a bone and its values")
        told(len(line))
        yield line.decode("ascii") if line.isascii() else decoded(line)


def _parse_amc(lines: Iterable[str], rig: AcclaimRig, name: object) -> tuple[dict[str, np.ndarray], bool, int]:
    """Each moving bone's values (T, its dof), whether angles are degrees, and T."""
    values = {bone.name: array("d") for bone in rig.bones.values() if bone.dof}
    degrees, frames, frame_line = rig.degrees, 0, 0
    for i, line in enumerate(lines, 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        if words[0].startswith(":"):
            degrees = {":degrees": True, ":radians": False}.get(words[0].lower(), degrees)
        elif len(words) == 1 and words[0].isdigit():
            _complete(values, rig, frames, f"{name}, line {frame_line}")
            frames, frame_line = frames + 1, i
        else:
            _amc_line(values, frames, rig, words, f"{name}, line {i}")
    if not frames:
        raise InputError(name, "no frames", "an AMC file must hold numbered frames")
    _complete(values, rig, frames, f"{name}, line {frame_line}")
    found = {bone: np.frombuffer(numbers).reshape(frames, -1) for bone, numbers in values.items()}
    for bone, numbers in found.items():
        if not np.isfinite(numbers).all():
            at = int(np.argwhere(~np.isfinite(numbers))[0, 0])
            raise InputError(name, f"frame {at + 1}, bone {bone}", "values must be finite")
    return found, degrees, frames


def _amc_line(values: dict[str, array], frames: int, rig: AcclaimRig, words: list[str], where: str) -> None:
    """Adds a bone's values of the frame that is read, the last of `frames`."""
    bone = rig.bones.get(words[0])
    if bone is None or not frames:
        raise InputError(where, words[0], "must be a bone of the ASF file" if frames else "a frame number comes first")
    if len(words) - 1 != len(bone.dof):
        raise InputError(where, " ".join(words), f"{bone.name} has {len(bone.dof)} degrees of freedom")
    try:
        numbers = [float(word) for word in words[1:]]
    except ValueError:
        raise InputError(where, " ".join(words), "values must be numbers") from None
    if numbers:
        del values[bone.name][(frames - 1) * len(numbers) :]  # of a bone that comes twice, the later ones
        values[bone.name].extend(numbers)


def _complete(values: dict[str, array], rig: AcclaimRig, frames: int, where: str) -> None:
    if missing := [bone for bone, numbers in values.items() if len(numbers) < frames * len(rig.bones[bone].dof)]:
        raise InputError(where, ", ".join(missing), f"frame {frames} lacks these (truncated?)")


def _track(rig: AcclaimRig, values: dict[str, np.ndarray], degrees: bool, frames: int) -> Track:
    names = ["root"]
    for name in names:  # grows while it runs: parents before children
        names += [child for child, parent in rig.parents.items() if parent == name]
    joints, parents = list(names), [names.index(rig.parents[n]) if n in rig.parents else -1 for n in names]
    for name in names:
        if name not in rig.parents.values() and np.any(rig.bones[name].vector):
            joints.append(f"{name}_end")
            parents.append(names.index(name))
    rotations = np.empty((frames, len(joints), 4), np.float32)
    rotations[:] = (0, 0, 0, 1)
    offsets = np.array([rig.bones[names[parents[j]]].vector if j else rig.position for j in range(len(joints))])
    moves = {}
    for j, name in enumerate(joints):
        if name not in values:
            continue
        bone = rig.bones[name]
        turns = [c for c, dof in enumerate(bone.dof) if dof in TURNS][::-1]  # the first one turns first
        for some in stretches(frames):
            angles = values[name][some, turns]
            local = euler_to_unitquat([TURNS[bone.dof[c]] for c in turns], np.radians(angles) if degrees else angles)
            rotations[some, j] = quat_product(quat_product(bone.axis, local), quat_conjugation(bone.axis))
        if places := [c for c, dof in enumerate(bone.dof) if dof in MOVES]:
            moves[j] = np.repeat(offsets[None, j], frames, axis=0)
            moves[j][:, [MOVES[bone.dof[c]] for c in places]] += values[name][:, places]
    return Track(tuple(joints), tuple(parents), rotations, offsets, moves)
