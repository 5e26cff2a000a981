"""Animation of glTF 2.0 files (.glb, .gltf): the joints of the first skin, or the nodes that move, over time.

A node's own axes can be anything, as those of bones in Blender are. The skeleton that comes out has the world's axes
and the pose in which the skin was bound (without a skin: in which the nodes rest), so that its offsets are a person's.
"""

from __future__ import annotations

import os
from collections.abc import Container, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.formats.animated_rig import Track, unique_names
from motionary.formats.gltf_channels import Channel, KeySource, channels_of, rate_of, sources_of
from motionary.formats.gltf_file import GENERATOR, GltfFile
from motionary.formats.measure.unit import USUAL as UNIT_USUAL
from motionary.formats.read.extent import check_extent
from motionary.formats.read.reading_options import Reading, ReadingOptions
from motionary.formats.tracks import to_motion
from motionary.motion import Motion
from motionary.motion.motion import FASTEST_RATE, SLOWEST_RATE
from motionary.motion.rotations import (
    quat_action,
    quat_conjugation,
    quat_product,
    rotmat_to_unitquat,
    unitquat_to_rotmat,
)
from motionary.motion.skeleton import MOST_JOINTS

_OURS = ReadingOptions(up="y", unit=1.0, mirror=False, skip_first=False)
# By the format's definition y is up and units are metres; converters of other formats do not always care.
_USUAL = {"up": {"y": 3.0, "z": 0.5}, "unit": UNIT_USUAL | {"m": 2.0}, "mirror": {"no": 2.0}}
_STILL = 1e-6  # of a translation's size
_UNEVEN = 1e-3
_RARE = 5.0  # s between keys


def gltf_with(
    path: str | os.PathLike,
    options: ReadingOptions | None = None,
    fps: float | None = None,
    animation: str | None = None,
) -> tuple[Motion, Reading]:
    """Read the animation of a .glb or .gltf file; and how it was read.

    Joints are those of the first skin and what lies between them, or without a skin the nodes that are moved, up to
    the highest node that moves. LINEAR, STEP and CUBICSPLINE keys are sampled at one rate.

    Args:
        path: the file; buffers may lie in it, in its text, or in files beside it.
        options: what the user knows of the file.
        fps: frames per second of the result; None: that of the keys.
        animation: the name of one; None takes the first that moves a joint.

    Raises:
        InputError: no animation of joints, a damaged file, or one that needs what is not read: file, part and rule.
    """
    if fps is not None and not SLOWEST_RATE <= fps <= FASTEST_RATE:
        raise InputError("fps", fps, f"must be frames per second, {SLOWEST_RATE:g} to {FASTEST_RATE:g}")
    file, options = GltfFile.read(path), options or ReadingOptions()
    sources, notes = _animation(file, animation)
    joints = _joints(file, {node for node, path in sources if path != "scale"})
    among = set(joints)
    channels = channels_of(file, {key: source for key, source in sources.items() if key[0] in among})
    ours = file.document["asset"].get("generator") == GENERATOR
    rate = fps or _written_rate(file, ours) or rate_of(channels.values())
    times = _times(file, channels, rate, len(joints))
    notes += [*_uneven(file, joints, channels), *_rare_keys(channels)]
    track = _track(file, joints, channels, times, rate, ours)
    del file, channels
    motion, reading = to_motion(track, rate, path, options.over(_OURS) if ours else options, _USUAL)
    return motion, replace(reading, notes=(*notes, *reading.notes))


def _animation(file: GltfFile, wanted: str | None) -> tuple[dict[tuple[int, str], KeySource], list[str]]:
    """Where the channels lie of the animation that is read, and what to say of others."""
    entries = file.entries("animations")
    names = [str(entry.get("name", f"animation{i}")) for i, entry in enumerate(entries)]
    if wanted is not None and wanted not in names:
        raise file.wrong("animation", wanted, f"must be one of {', '.join(names) or 'none, for it holds none'}")
    skinned = {joint for skin in file.skins[:1] for joint in skin}
    for name, entry in zip(names, entries, strict=True):
        if wanted not in (None, name):
            continue
        sources = sources_of(file, entry, f"animation {name}")
        if any(path != "scale" and (node in skinned or not skinned) for node, path in sources):
            otherwise = "(say otherwise with --animation; in Python animation=)"
            others = ", ".join(names[:8]) + ", ..." * (len(names) > 8)
            several = f"holds {len(names)} animations, {others}; took {name} {otherwise}"
            return sources, [several] if wanted is None and len(names) > 1 else []
    raise file.wrong("animations", f"{len(entries)}", "one must move joints of the skin, or nodes where there is none")


def _joints(file: GltfFile, moved: set[int]) -> list[int]:
    """The nodes that are joints where some are moved, parents before children, else in the order of the file."""
    wanted = set(file.skins[0]) if file.skins else moved
    if len(wanted) > MOST_JOINTS:
        raise file.wrong("joints", len(wanted), f"must be at most {MOST_JOINTS}")
    parents = file.parents
    tops: dict[int, int] = {}  # of them and of all nodes above them
    for node in wanted:
        way = [node]
        while way[-1] in parents and way[-1] not in tops:
            way.append(parents[way[-1]])
        tops |= dict.fromkeys(way, tops.get(way[-1], way[-1]))
    theirs = [tops[node] for node in wanted]
    top = max(dict.fromkeys(theirs), key=theirs.count)  # what hangs elsewhere is a prop
    nodes = {node for node, its in tops.items() if its == top}
    shared = [top]
    while shared[-1] not in wanted and len(below := nodes.intersection(file.nodes[shared[-1]].children)) == 1:
        shared += below
    nodes.difference_update(shared[: next((k for k, node in enumerate(shared) if node in moved), len(shared) - 1)])
    if not file.skins:
        nodes |= _below(file, nodes)
    if len(nodes) > MOST_JOINTS:
        raise file.wrong("joints", len(nodes), f"must be at most {MOST_JOINTS}")
    return list(dict.fromkeys(node for last in sorted(nodes) for node in _way(file, last, nodes)))


def _way(file: GltfFile, node: int, among: Container[int] | None = None) -> list[int]:
    """From the top of its tree to the node; or from the highest of those `among` which it lies."""
    way, parents = [node], file.parents
    while (above := parents.get(way[-1])) is not None and (among is None or above in among):
        way.append(above)
    return way[::-1]


def _below(file: GltfFile, nodes: set[int]) -> set[int]:
    """What hangs on nodes, without what is seen or sees."""
    found, stack = set(), list(nodes)
    entries = file.entries("nodes")
    while stack:
        children = file.nodes[stack.pop()].children
        new = {c for c in children if not {"mesh", "camera", "extensions"} & entries[c].keys()} - found
        found |= new
        stack += new
    return found


def _written_rate(file: GltfFile, ours: bool) -> float | None:
    """The rate that our own writer noted."""
    extras = file.document["asset"].get("extras")
    rate = extras.get("fps") if ours and isinstance(extras, dict) else None
    known = isinstance(rate, int | float) and not isinstance(rate, bool) and SLOWEST_RATE <= rate <= FASTEST_RATE
    return float(rate) if known and rate is not None else None


def _times(file: GltfFile, channels: Mapping[Any, Channel], rate: float, joints: int) -> np.ndarray:
    """(T,) seconds of the frames, from the first key to the last one."""
    first = min(float(channel.times[0]) for channel in channels.values())
    last = max(float(channel.times[-1]) for channel in channels.values())
    frames = int(min((last - first) * rate + 1.05, 1e15))
    check_extent(file.path, f"{frames:,} frames of {joints} joints", frames * joints, file.size)
    return first + np.arange(frames) / rate


def _uneven(file: GltfFile, joints: list[int], channels: Mapping[tuple[int, str], Channel]) -> list[str]:
    """What scales do that a skeleton cannot."""
    scales = {node: file.nodes[node].scale for node in (*_way(file, joints[0]), *joints)}
    if mirrors := [node for node, scale in scales.items() if (scale <= 0).any()]:
        scale = scales[mirrors[0]].tolist()
        raise file.wrong(f"node {mirrors[0]}, scale", scale, "must be above 0: apply scales before exporting")
    uneven = [node for node, scale in scales.items() if np.ptp(scale) > _UNEVEN * np.abs(scale).max()]
    for (node, path), channel in channels.items():
        if path == "scale" and np.abs(channel.values - scales[node]).max() > _UNEVEN * np.abs(scales[node]).max():
            uneven.append(node)
    if not uneven:
        return []
    names = ", ".join(file.nodes[node].name for node in dict.fromkeys(uneven))
    return [f"scales that change or differ by axis were left aside, so bones may have other lengths: {names}"]


def _rare_keys(channels: Mapping[Any, Channel]) -> list[str]:
    """What to say of keys that lie so far apart that their times may be no seconds."""
    steps = [float(np.median(np.diff(channel.times))) for channel in channels.values() if len(channel.times) > 1]
    if not steps or (apart := min(steps)) <= _RARE:
        return []
    otherwise = "(say otherwise by dividing them by 1000 in the file)"
    return [f"keys lie {apart:.3g} s apart, as where times are milliseconds: glTF's are seconds {otherwise}"]


def _track(
    file: GltfFile,
    joints: list[int],
    channels: Mapping[tuple[int, str], Channel],
    times: np.ndarray,
    rate: float,
    ours: bool,
) -> Track:
    """The joints over time, with the axes of the world in the pose of the bind."""
    place = {node: j for j, node in enumerate(joints)}
    parents = tuple(place.get(file.parents.get(node, -1), -1) for node in joints)
    above, turn, size = _above(file, joints[0])
    bind = np.tile([0.0, 0, 0, 1], (len(joints), 1)) if ours else _bind(file, joints, parents, turn)
    rotations = np.empty((len(times), len(joints), 4), np.float32)
    offsets, moves = np.zeros((len(joints), 3)), {}
    sizes = np.empty(len(joints))  # of what hangs on each joint, without the joint's own scale
    for j, (node, p) in enumerate(zip(joints, parents, strict=True)):
        rest, turned = file.nodes[node], channels.get((node, "rotation"))
        local = rest.rotation if turned is None else turned.at(times, rate)
        rotations[:, j] = quat_product(quat_product(turn if j == 0 else bind[p], local), quat_conjugation(bind[j]))
        moved = channels.get((node, "translation"))
        places = rest.translation[None] if moved is None else moved.at(times, rate)
        if j == 0:
            sizes[j] = size
            places = places @ above[:3, :3].T + above[:3, 3]
        else:
            own = file.nodes[joints[p]].scale
            sizes[j] = sizes[p] * own.mean()
            places = quat_action(bind[p], sizes[p] * own * places)
        offsets[j] = places[0]
        if np.ptp(places, axis=0).max() > _STILL * np.abs(places).max():
            moves[j] = places
    return Track(unique_names([file.nodes[node].name for node in joints]), parents, rotations, offsets, moves)


def _above(file: GltfFile, root: int) -> tuple[np.ndarray, np.ndarray, float]:
    """What the nodes above the root joint do at rest: (4, 4), its rotation as a quaternion, and its size."""
    matrix = np.eye(4)
    for node in map(file.nodes.__getitem__, _way(file, root)[:-1]):
        step = np.eye(4)
        step[:3, :3] = unitquat_to_rotmat(node.rotation) * node.scale
        step[:3, 3] = node.translation
        matrix = matrix @ step
    columns = np.linalg.norm(matrix[:3, :3], axis=0)
    return matrix, rotmat_to_unitquat(matrix[:3, :3] / columns), float(columns.mean())


def _bind(file: GltfFile, joints: list[int], parents: tuple[int, ...], turn: np.ndarray) -> np.ndarray:
    """(J, 4) global rotations of the joints in the pose in which the skin was bound."""
    inverse = file.inverse_bind()
    found = np.empty((len(joints), 4))
    for j, (node, p) in enumerate(zip(joints, parents, strict=True)):
        above = np.eye(4) if p < 0 else inverse.get(joints[p])
        bound = None if above is None or node not in inverse else _rotation(above @ np.linalg.inv(inverse[node]))
        if bound is None:
            found[j] = quat_product(turn if p < 0 else found[p], file.nodes[node].rotation)
        else:
            found[j] = bound if p < 0 else quat_product(found[p], bound)
    return found


def _rotation(matrix: np.ndarray) -> np.ndarray | None:
    """The rotation of a matrix (4, 4) as a quaternion, None where it has none."""
    columns = np.linalg.norm(matrix[:3, :3], axis=0)
    whole = columns.min() > 0 and np.linalg.det(matrix[:3, :3]) > 0
    return rotmat_to_unitquat(matrix[:3, :3] / columns) if whole else None
