"""From a rig as a file gives it (any unit, axes and names) to a `Motion`; and from a `Motion` to local transforms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from motionary.errors import InputError
from motionary.formats.animated_rig import Track, kept, stretches
from motionary.formats.first_frame import DOUBT, held_calibration, held_line, is_calibration
from motionary.formats.read.extent import FARTHEST
from motionary.formats.read.reading_options import Reading, ReadingOptions
from motionary.formats.read.settle import settle, with_roles
from motionary.motion import Motion, Skeleton, fit_rotations
from motionary.motion.rigs import REQUIRED, find_roles
from motionary.motion.roles import chains_of, contradictions, disagreements, names_by_role, read_mapping, roles_of
from motionary.motion.rotations import quat_action, quat_conjugation, quat_product
from motionary.motion.skeleton import NAMED
from motionary.motion.tree import roles_by_tree

_WRITTEN = 5e-4  # metres; where rotations miss a joint by more, a file gets that joint's translation too


def to_motion(
    track: Track,
    fps: float,
    file: object,
    options: ReadingOptions,
    usual: Mapping[str, Mapping[str, float]] | None = None,
) -> tuple[Motion, Reading]:
    """Metres, y up, without placement nodes and without a T-pose put before the motion; and how that was decided.

    Args:
        track: what the file holds.
        fps: frames per second.
        file: its name, for errors.
        options: what the user says; a mapping counts before anything is measured.
        usual: by "up", "unit" and "mirror", log-odds in favour of what files of a format with such rules hold, which
            is in metres, so that a rig without known roles is not scaled by its size.

    Raises:
        InputError: a mapping does not fit, or the result is not a valid motion.
    """
    if (far := max(float(np.abs(places).max()) for places in (track.offsets, *track.moves.values()))) > FARTHEST:
        raise InputError(file, f"{far:.3g}", f"offsets and positions must lie within {FARTHEST:g} units")
    track = _without_placement_nodes(track)
    positions = track.place()
    rest = track.rest
    track, roles, source, notes = _cast(track, positions, rest, options)
    resting = np.zeros_like(rest)
    for j, p in enumerate(track.parents[1:], 1):
        resting[j] = resting[p] + rest[j]
    chain = _longest_chain(track, rest) if usual is None else None
    settled = settle(positions, roles, fps, options, resting, chain, usual)
    settled = with_roles(settled, source, notes)
    reading, rotations = settled.reading, track.rotations
    for some in stretches(len(positions)):
        positions[some] = settled.points(positions[some].astype(np.float64))
        rotations[some] = settled.rotations(rotations[some].astype(np.float64))
    skip = is_calibration(roles, positions, rotations) if options.skip_first is None else options.skip_first
    if skip is None:
        reading = replace(reading, notes=(*reading.notes, DOUBT))
    if options.skip_first is None and (held := held_calibration(roles, positions)):
        reading = replace(reading, notes=(*reading.notes, held_line(held, fps)))
    if skip and len(positions) > 1:
        positions, rotations = positions[1:], rotations[1:]
        reading = replace(reading, skipped_first=True)
    try:
        skeleton, order = _skeleton(track, settled.offsets(rest))
        if order != list(range(len(order))):
            positions, rotations = kept(positions, order), kept(rotations, order)
        return Motion(positions, fps, skeleton, rotations), reading
    except InputError as error:
        raise InputError(f"{file}, {error.what}", error.value, error.rule) from None


def _cast(
    track: Track, positions: np.ndarray, rest: np.ndarray, options: ReadingOptions
) -> tuple[Track, dict[str, int], str, list[str]]:
    """The track with joints called by their roles where names do not tell them, the roles, their source, and notes."""
    roles, source = roles_of(track.joints, track.parents, rest), "names"
    if not all(role in find_roles(track.joints) for role in REQUIRED):
        source = "tree" if roles else "unknown"
    renamed: dict[str, int] = {}
    notes: list[str] = []
    against: list[str] = []
    if options.mapping is not None:
        renamed, source = read_mapping(options.mapping, track.joints), "mapping"
        against += disagreements(renamed, roles, track.joints)
    elif not all(role in roles for role in REQUIRED):
        some = np.unique(np.linspace(0, len(positions) - 1, 50).astype(int))
        if renamed := roles_by_tree(track.joints, track.parents, rest, positions[some].astype(np.float64)):
            source = "tree"
            notes.append("left and right were told by the motion, not by names: joints are called by their roles")
    joints = track.joints
    if renamed:
        track = replace(track, joints=tuple(names_by_role(track.joints, roles, renamed)))
        roles = {role: joint for role, joint in roles.items() if joint not in renamed.values()} | renamed
    against += contradictions(roles, joints, track.parents)
    if against:
        notes.append(f"{'; '.join(against)}: does the mapping fit? (--mapping)")
    return track, roles, source, notes


def _longest_chain(track: Track, rest: np.ndarray) -> float:
    lengths = np.linalg.norm(rest, axis=-1)
    return float(max(sum(lengths[list(chain[1:])]) for chain in chains_of(track.parents)))


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
    while sum(p == 0 for p in track.parents) == 1 and 1 in track.moves:
        away = np.abs(track.moves[1] - track.moves[1][0]).max()
        if away <= 1e-3 * np.linalg.norm(track.rest[2:], axis=-1).max(initial=0):
            break
        track = track.without_root()
    return track


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
