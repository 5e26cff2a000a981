"""A motion written onto the character of a .glb file: its nodes, mesh and skin stay, its animations are replaced."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.files import write_bytes
from motionary.formats.animated_rig import unique_names
from motionary.formats.dispatch import DAMAGED_RIG, about, foreseen
from motionary.formats.gltf_container import packed
from motionary.formats.gltf_file import GENERATOR, GltfFile, GltfNode
from motionary.motion import Motion, Skeleton
from motionary.motion.motion import FARTHEST
from motionary.motion.rigging import Rig, to_rig
from motionary.motion.rotations import quat_continuation, rotmat_to_unitquat, unitquat_to_rotmat
from motionary.motion.skeleton import MOST_JOINTS

_LARGEST = 1e9  # times that the nodes above a node may enlarge it, or make it smaller


@dataclass(frozen=True)
class Character:
    """A .glb file with a skin.

    Attributes:
        file: its glTF.
        nodes: (J,) the node of each joint, parents before children.
        above: (4, 4) what the nodes above the root joint do, at rest.
        rig: skeleton and pose of the skin, metres, y up.
    """

    file: GltfFile
    nodes: list[int]
    above: np.ndarray
    rig: Rig

    @staticmethod
    def read(path: str | os.PathLike) -> Character:
        """Read a character.

        Raises:
            InputError: not glTF 2.0 in one file, damaged, or without a skin on one tree of joints.
        """
        file = GltfFile.read(path)
        for key in ("bufferViews", "accessors", "animations"):
            file.entries(key)  # what is written beside them must find lists
        if any("uri" in buffer for buffer in file.entries("buffers")[:1]):
            raise file.wrong("buffer 0, uri", file.document["buffers"][0]["uri"], "must lie inside the .glb")
        order = _tree(file)
        file.inverse_bind()  # which readers need of what is written
        parents, place = file.parents, {node: k for k, node in enumerate(order)}
        above = [place[parents[node]] if k else -1 for k, node in enumerate(order)]
        base = _above(file, order[0])
        world: list[np.ndarray] = []
        for node, parent in zip(order, above, strict=True):
            world.append((world[parent] if world else base) @ _matrix(file, node))
        turned = np.array([_rotation(matrix) for matrix in world])
        points = np.array([matrix[:3, 3] for matrix in world])
        _check_reach(file, [file.parents.get(order[0], order[0]), *order], [base, *world])
        offsets, pose = np.zeros((len(order), 3)), turned.copy()
        for j, p in enumerate(above[1:], 1):
            offsets[j] = turned[p].T @ (points[j] - points[p])
            pose[j] = turned[p].T @ turned[j]
        names = unique_names([file.nodes[node].name for node in order])
        rig = Rig.posed(Skeleton.from_rig(Path(path).stem, names, above, offsets), pose)
        return Character(file, order, base, rig)


def write_glb_onto(motion: Motion, onto: str | os.PathLike, path: str | os.PathLike, force: bool = True) -> Path:
    """Write a motion as .glb on the character of another: only its animations change.

    Raises:
        InputError: the character's file is not readable or lacks a role, or the place cannot be written.
    """
    with foreseen(onto, DAMAGED_RIG), about(onto):
        character = Character.read(onto)
        data = [character.file.data]
    moved = to_rig(motion, character.rig)
    assert moved.rotations is not None
    document = json.loads(json.dumps(character.file.document))
    document["buffers"] = document.get("buffers") or [{"byteLength": 0}]
    time = (np.arange(moved.frames) / moved.fps).astype(np.float32)
    clock = _add(document, data, time, bounds=True)
    channels, samplers = [], []

    def channel(joint: int, what: str, values: np.ndarray) -> None:
        """Adds one animated property of a joint."""
        channels.append({"sampler": len(samplers), "target": {"node": character.nodes[joint], "path": what}})
        output = _add(document, data, np.ascontiguousarray(values, np.float32))
        samplers.append({"input": clock, "output": output, "interpolation": "LINEAR"})

    rotations = moved.rotations.astype(np.float64)
    turn = _rotation(character.above).T @ unitquat_to_rotmat(rotations[:, 0])
    rotations[:, 0] = rotmat_to_unitquat(turn)
    rotations = quat_continuation(rotations)
    inverse = np.linalg.inv(character.above)
    channel(0, "translation", moved.positions[:, 0] @ inverse[:3, :3].T + inverse[:3, 3])
    for joint, node in enumerate(character.nodes):
        _as_parts(document["nodes"][node], character.file.nodes[node])
        channel(joint, "rotation", rotations[:, joint])
    document["animations"] = [{"name": "motion", "channels": channels, "samplers": samplers}]
    document["buffers"][0]["byteLength"] = sum(map(len, data))
    if (asset := document["asset"]).get("generator") == GENERATOR:  # whose readers look for the rate there
        extras = asset.get("extras")
        asset["extras"] = (extras if isinstance(extras, dict) else {}) | {"fps": motion.fps}
    return write_bytes(path, packed(document, *data), force)


def _add(document: dict[str, Any], data: list[bytes], values: np.ndarray, bounds: bool = False) -> int:
    """The index of a new accessor for float32 values (N,), (N, 3) or (N, 4); pieces of the buffer grow by theirs."""
    end = sum(map(len, data))
    start = end + -end % 4
    data.append(b"\0" * (start - end))
    views, accessors = document.setdefault("bufferViews", []), document.setdefault("accessors", [])
    views.append({"buffer": 0, "byteOffset": start, "byteLength": values.nbytes})
    data.append(values.tobytes())
    kind = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[values.size // len(values)]
    accessor = {"bufferView": len(views) - 1, "componentType": 5126, "count": len(values), "type": kind}
    if bounds:
        accessor |= {"min": [float(values.min())], "max": [float(values.max())]}
    accessors.append(accessor)
    return len(accessors) - 1


def _tree(file: GltfFile) -> list[int]:
    """The nodes of the skins' joints and what lies between them, parents before children."""
    parents = file.parents
    joints = {joint for skin in file.skins for joint in skin}
    if not joints:
        raise InputError(file.path, "no skin", "must hold a character with a skin, whose joints a motion can move")
    depth: dict[int, int] = {}  # of the joints and of all nodes above them
    for joint in joints:
        way = [joint]
        while way[-1] in parents and way[-1] not in depth:
            way.append(parents[way[-1]])
        first = depth.get(way[-1], 0)
        depth |= {node: first + k for k, node in enumerate(reversed(way))}
    top = min(joints, key=lambda joint: (depth[joint], joint))
    inside = {top}
    for node in sorted(depth, key=lambda node: depth[node]):
        if parents.get(node) in inside:
            inside.add(node)
    if loose := joints - inside:
        raise InputError(file.path, f"{len(loose) + 1} roots", "the skin's joints must hang on one of them")
    if len(inside) > MOST_JOINTS:
        raise InputError(file.path, f"{len(inside)} joints", f"must be at most {MOST_JOINTS}")
    return sorted(inside, key=lambda node: (depth[node], node))


def _above(file: GltfFile, top: int) -> np.ndarray:
    """(4, 4) what the nodes above one do, at rest."""
    result, node = np.eye(4), file.parents.get(top)
    while node is not None:
        result, node = _matrix(file, node) @ result, file.parents.get(node)
    return result


def _matrix(file: GltfFile, i: int) -> np.ndarray:
    """(4, 4) of a node at rest."""
    node = file.nodes[i]
    if not (node.scale > 0).all():
        raise file.wrong(f"node {i}, scale", node.scale.tolist(), "must be above 0")
    result = np.eye(4)
    result[:3, :3] = unitquat_to_rotmat(node.rotation) * node.scale
    result[:3, 3] = node.translation
    return result


def _check_reach(file: GltfFile, nodes: list[int], world: list[np.ndarray]) -> None:
    """InputError for the first of the nodes whose matrix (4, 4) in the world leaves what a motion can hold."""
    for node, matrix in zip(nodes, world, strict=True):
        sizes = np.linalg.norm(matrix[:3, :3], axis=0)
        if not (np.abs(matrix[:3, 3]) <= FARTHEST).all() or not ((sizes > 1 / _LARGEST) & (sizes < _LARGEST)).all():
            shown = f"at {matrix[:3, 3].tolist()}, scaled by {sizes.tolist()}"
            rule = f"must rest within {FARTHEST:g} m of the origin, scaled by {1 / _LARGEST:g} to {_LARGEST:g}"
            raise file.wrong(f"node {node}", shown, rule)


def _as_parts(entry: dict[str, Any], node: GltfNode) -> None:
    """Animated nodes must have translation, rotation and scale in place of a matrix (glTF 2.0, 3.6.2)."""
    if entry.pop("matrix", None) is not None:
        entry["translation"], entry["rotation"] = node.translation.tolist(), node.rotation.tolist()
        entry["scale"] = node.scale.tolist()


def _rotation(matrix: np.ndarray) -> np.ndarray:
    return matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
