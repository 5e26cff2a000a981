"""From a rig as a file gives it (any unit, any up axis) to a `Motion`; and from a `Motion` to local transforms."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from motionary.errors import InputError
from motionary.motion import Motion, Skeleton, fit_rotations
from motionary.motion.rotations import quat_action, quat_conjugation, quat_product
from motionary.motion.skeleton import NAMED

# Metres per unit: metre, centimetre, millimetre, inch, and the unit of the Acclaim files of CMU and of what was made
# from them (cgspeed's MotionBuilder conversion): 0.45 of them are an inch, 0.0254 / 0.45.
CMU_UNIT = 0.0254 / 0.45
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "cmu": CMU_UNIT}
_LEG = 0.85  # metres from hip to ankle of a typical adult
_LONGEST_CHAIN = 1.35  # metres from the root through the spine to a hand, where a rig has no known legs
_STILL = 1e-4  # metres; below this, a translation is rounding
_WRITTEN = 5e-4  # metres; where rotations miss a joint by more, a file gets that joint's translation too
_Y_FROM_Z = np.array([-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])  # turns z up into y up: (x, y, z) -> (x, z, -y)


@dataclass(frozen=True)
class Track:
    """An animated rig in the file's own unit and axes.

    Attributes:
        joints: (J,) names, parents before children.
        parents: (J,) indices, -1 for the root.
        rotations: (T, J, 4) local unit quaternions xyzw.
        translations: (T, J, 3) of each joint from its parent, in the parent's frame; the root's is global.
    """

    joints: tuple[str, ...]
    parents: tuple[int, ...]
    rotations: np.ndarray
    translations: np.ndarray

    def place(self) -> tuple[np.ndarray, np.ndarray]:
        """Global positions (T, J, 3) and rotations (T, J, 4)."""
        positions, rotations = self.translations.copy(), self.rotations.copy()
        for j, p in enumerate(self.parents[1:], 1):
            positions[:, j] = positions[:, p] + quat_action(rotations[:, p], self.translations[:, j])
            rotations[:, j] = quat_product(rotations[:, p], self.rotations[:, j])
        return positions, rotations

    @property
    def offsets(self) -> np.ndarray:
        """(J, 3) rest offsets: the median translation over time; zero for the root."""
        offsets = np.median(self.translations, axis=0)
        offsets[0] = 0
        return offsets


def to_motion(
    track: Track, fps: float, file: object, unit: str | float | None, up: str | None, skip_first: bool | None
) -> Motion:
    """Metres, y up, without placement nodes and without a T-pose put before the motion.

    Args:
        track: what the file holds.
        fps: frames per second.
        file: its name, for errors.
        unit: metres per unit, or a key of `UNITS`; None finds it by the length of the legs.
        up: "y" or "z"; None finds it (see `_up_axis`).
        skip_first: drop the first frame; None drops it if it is a T-pose (see `_starts_with_t_pose`).

    Raises:
        InputError: an option has no such value, or the result is not a valid motion.
    """
    track = _without_placement_nodes(track)
    skeleton = Skeleton.from_rig("rig", track.joints, track.parents, track.offsets)
    scale = _unit(skeleton) if unit is None else _given_unit(unit)
    if up not in (None, "y", "z"):
        raise InputError("up", up, "must be 'y' or 'z' (None: found)")
    positions, _ = track.place()
    if (up or _up_axis(skeleton, positions)) == "z":
        track = _turned(track, _Y_FROM_Z)
        positions = quat_action(_Y_FROM_Z, positions)
    positions, rotations = positions * scale, track.rotations
    if skip_first is None:
        skip_first = _starts_with_t_pose(skeleton, positions)
    if skip_first and len(positions) > 1:
        positions, rotations = positions[1:], rotations[1:]
    try:
        skeleton, order = _skeleton(track, track.offsets * scale)
        positions, rotations = positions[:, order], rotations[:, order]
        return Motion(positions.astype(np.float32), fps, skeleton, rotations.astype(np.float32))
    except InputError as error:
        raise InputError(f"{file}, {error.what}", error.value, error.rule) from None


def _skeleton(track: Track, offsets: np.ndarray) -> tuple[Skeleton, list[int]]:
    """The rig's skeleton and its joints' places in the file: a named skeleton that was written keeps its own order."""
    names = [track.joints[p] if p >= 0 else None for p in track.parents]
    tree = dict(zip(track.joints, names, strict=True))
    for known in map(Skeleton.named, NAMED):
        parents = [known.joints[p] if p >= 0 else None for p in known.parents]
        if tree == dict(zip(known.joints, parents, strict=True)):
            order = [track.joints.index(joint) for joint in known.joints]
            same = np.allclose(offsets[order][1:], known.offsets[1:], atol=1e-6)
            return known if same else known.with_offsets(offsets[order]), order
    name = f"{track.joints[0]}-{len(track.joints)}"
    return Skeleton.from_rig(name, track.joints, track.parents, offsets), list(range(len(track.joints)))


def _without_placement_nodes(track: Track) -> Track:
    """Fold a root that only carries another moving root (Bandai-Namco's joint_Root) into that one.

    Its child's translation is animated, which rotations on constant bones could not express.
    """
    while sum(p == 0 for p in track.parents) == 1:
        away = np.abs(track.translations[:, 1] - track.translations[:1, 1]).max()
        if away <= 1e-3 * np.linalg.norm(track.offsets[2:], axis=-1).max(initial=0):
            break
        positions, rotations = track.place()
        local, moved = track.rotations[:, 1:].copy(), track.translations[:, 1:].copy()
        local[:, 0], moved[:, 0] = rotations[:, 1], positions[:, 1]
        track = Track(track.joints[1:], tuple(p - 1 for p in track.parents[1:]), local, moved)
    return track


def _given_unit(unit: str | float) -> float:
    value = UNITS.get(unit, 0.0) if isinstance(unit, str) else unit
    if not (np.isfinite(value) and value > 0):
        raise InputError("unit", unit, f"must be metres per unit, above 0, or one of {', '.join(UNITS)}")
    return float(value)


def _unit(skeleton: Skeleton) -> float:
    """The known unit under which the legs (without known legs: the longest chain) come nearest to a person's."""
    roles, lengths = skeleton.roles, skeleton.bone_lengths
    if {"left_hip", "left_ankle"} <= roles.keys():
        size, joint = 0.0, roles["left_ankle"]
        while joint not in (roles["left_hip"], -1):
            size, joint = size + lengths[joint], skeleton.parents[joint]
        expected = _LEG
    else:
        size = max(sum(lengths[list(chain[1:])]) for chain in skeleton.chains)
        expected = _LONGEST_CHAIN
    if size <= 0:
        return UNITS["m"]
    return min(UNITS.values(), key=lambda scale: abs(np.log(size * scale / expected)))


def _up_axis(skeleton: Skeleton, positions: np.ndarray) -> str:
    """ "z" where the head stands over the feet along z through most of the motion, and not along y at rest."""
    roles = skeleton.roles
    if not {"head", "left_ankle", "right_ankle"} <= roles.keys():
        return "y"
    head, left, right = (roles[name] for name in ("head", "left_ankle", "right_ankle"))
    rest = np.zeros((len(skeleton.joints), 3))
    for j, p in enumerate(skeleton.parents[1:], 1):
        rest[j] = rest[p] + skeleton.offsets[j]
    spine = np.median(positions[:, head] - (positions[:, left] + positions[:, right]) / 2, axis=0)
    at_rest = rest[head] - (rest[left] + rest[right]) / 2
    stands = lambda v, axis, other: v[axis] > 2 * abs(v[other])  # noqa: E731
    return "z" if stands(spine, 2, 1) and not stands(at_rest, 1, 2) else "y"


def _turned(track: Track, turn: np.ndarray) -> Track:
    """The same rig with all its axes turned, the rest pose's too."""
    rotations = quat_product(
        quat_product(np.broadcast_to(turn, track.rotations.shape), track.rotations), quat_conjugation(turn)
    )
    return replace(track, rotations=rotations, translations=quat_action(turn, track.translations))


def _starts_with_t_pose(skeleton: Skeleton, positions: np.ndarray) -> bool:
    """A calibration pose put before the motion, as in cgspeed's files.

    The rule: in the first frame both upper arms and forearms lie within 25 degrees of the line through the shoulders
    and both legs within 25 degrees of the vertical; and from it to the second frame the joints move, relative to the
    root, 5 cm or more on average and at least five times as far as between later frames (95th percentile).
    """
    roles = skeleton.roles
    names = [f"{side}_{part}" for part in ("shoulder", "elbow", "wrist", "hip", "ankle") for side in ("left", "right")]
    if len(positions) < 3 or not set(names) <= roles.keys():
        return False
    first = {name: positions[0, roles[name]] for name in names}
    across = first["left_shoulder"] - first["right_shoulder"]
    bones = [("shoulder", "elbow", across), ("elbow", "wrist", across), ("hip", "ankle", np.array([0.0, -1.0, 0.0]))]
    for begin, end, line in bones:
        for side, sign in (("left", 1), ("right", 1 if begin == "hip" else -1)):
            bone = first[f"{side}_{end}"] - first[f"{side}_{begin}"]
            if bone @ line * sign < np.cos(np.radians(25)) * np.linalg.norm(bone) * np.linalg.norm(line):
                return False
    local = positions - positions[:, :1]
    steps = np.linalg.norm(np.diff(local, axis=0), axis=-1).mean(-1)
    return bool(steps[0] > 0.05 and steps[0] > 5 * np.percentile(steps[1:], 95))


@dataclass(frozen=True)
class Locals:
    """A motion as local transforms, for files: FK of these gives its joints within half a millimetre.

    Attributes:
        skeleton: rest offsets (metres).
        rotations: (T, J, 4) local unit quaternions xyzw, float64.
        translations: (T, J, 3) from the parent, in its frame; the root's is global.
        moving: (J,) bool: joints whose translation is not just their rest offset.
    """

    skeleton: Skeleton
    rotations: np.ndarray
    translations: np.ndarray
    moving: np.ndarray


def to_locals(motion: Motion) -> Locals:
    """Local transforms of a motion; rotations are fitted where it has none (then bones become constant)."""
    if motion.rotations is None:
        motion = fit_rotations(motion)
    assert motion.rotations is not None
    skeleton, positions = motion.skeleton, motion.positions.astype(np.float64)
    rotations = motion.rotations.astype(np.float64)
    rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    translations = np.repeat(skeleton.offsets[None].astype(np.float64), len(positions), axis=0)
    translations[:, 0] = positions[:, 0]
    turned, placed = rotations.copy(), positions.copy()
    moving = np.zeros(len(skeleton.joints), bool)
    moving[0] = True
    for j, p in enumerate(skeleton.parents[1:], 1):
        turned[:, j] = quat_product(turned[:, p], rotations[:, j])
        placed[:, j] = placed[:, p] + quat_action(turned[:, p], translations[:, j])
        if np.abs(placed[:, j] - positions[:, j]).max() > _WRITTEN:
            moving[j], placed[:, j] = True, positions[:, j]
            translations[:, j] = quat_action(quat_conjugation(turned[:, p]), positions[:, j] - placed[:, p])
    return Locals(skeleton, rotations, translations, moving)
