"""A motion written onto the character of a .glb file: its nodes, mesh and skin stay, its animations are replaced."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.files import readable, write_bytes
from motionary.formats.animated_rig import unique_names
from motionary.formats.gltf_file import chunks, packed
from motionary.motion import Motion, Skeleton
from motionary.motion.rigging import Rig, to_rig
from motionary.motion.rotations import quat_continuation, rotmat_to_unitquat, unitquat_to_rotmat


@dataclass(frozen=True)
class Character:
    """A .glb file with a skin.

    Attributes:
        document: glTF's JSON.
        data: its binary buffer.
        nodes: (J,) the node of each joint, parents before children.
        above: (4, 4) what the nodes above the root joint do, at rest.
        rig: skeleton and pose of the skin, metres, y up.
    """

    document: dict[str, Any]
    data: bytes
    nodes: list[int]
    above: np.ndarray
    rig: Rig

    @staticmethod
    def read(path: str | os.PathLike) -> Character:
        """Read a character.

        Raises:
            InputError: not glTF 2.0 in one file, or without a skin on one tree of joints.
        """
        document, data = chunks(readable(path))
        nodes = document.get("nodes", [])
        parent = {child: i for i, node in enumerate(nodes) for child in node.get("children", [])}
        joints = {joint for skin in document.get("skins", []) for joint in skin["joints"]}
        if not joints:
            raise InputError(path, "no skin", "must hold a character with a skin, whose joints a motion can move")
        order = _tree(joints, parent, path)
        world = _worlds(nodes, parent)
        turned = np.array([_rotation(world[node]) for node in order])
        points = np.array([world[node][:3, 3] for node in order])
        above = [order.index(parent[node]) if k else -1 for k, node in enumerate(order)]
        offsets, pose = np.zeros((len(order), 3)), turned.copy()
        for j, p in enumerate(above[1:], 1):
            offsets[j] = turned[p].T @ (points[j] - points[p])
            pose[j] = turned[p].T @ turned[j]
        names = unique_names([nodes[node].get("name", f"node{node}") for node in order])
        rig = Rig.posed(Skeleton.from_rig(Path(path).stem, names, above, offsets), pose)
        base = world[parent[order[0]]] if order[0] in parent else np.eye(4)
        return Character(document, data, order, base, rig)


def write_glb_onto(motion: Motion, onto: str | os.PathLike, path: str | os.PathLike, force: bool = True) -> Path:
    """Write a motion as .glb on the character of another: only its animations change.

    Raises:
        InputError: the character's file is not readable or lacks a role, or the place cannot be written.
    """
    character = Character.read(onto)
    moved = to_rig(motion, character.rig)
    assert moved.rotations is not None
    document, data = json.loads(json.dumps(character.document)), bytearray(character.data)
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
        _as_parts(document["nodes"][node])
        channel(joint, "rotation", rotations[:, joint])
    document["animations"] = [{"name": "motion", "channels": channels, "samplers": samplers}]
    document["buffers"][0]["byteLength"] = len(data)
    return write_bytes(path, packed(document, bytes(data)), force)


def _add(document: dict[str, Any], data: bytearray, values: np.ndarray, bounds: bool = False) -> int:
    """The index of a new accessor for float32 values (N,), (N, 3) or (N, 4)."""
    data += b"\0" * (-len(data) % 4)
    views, accessors = document.setdefault("bufferViews", []), document.setdefault("accessors", [])
    views.append({"buffer": 0, "byteOffset": len(data), "byteLength": values.nbytes})
    data += values.tobytes()
    kind = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[values.size // len(values)]
    accessor = {"bufferView": len(views) - 1, "componentType": 5126, "count": len(values), "type": kind}
    if bounds:
        accessor |= {"min": [float(values.min())], "max": [float(values.max())]}
    accessors.append(accessor)
    return len(accessors) - 1


def _tree(joints: set[int], parent: dict[int, int], path: object) -> list[int]:
    """The joints and what lies between them, parents before children."""
    ways = {}
    for joint in joints:
        way = [joint]
        while way[-1] in parent:
            way.append(parent[way[-1]])
        ways[joint] = way[::-1]
    top = min(joints, key=lambda joint: len(ways[joint]))
    if loose := [joint for joint in joints if top not in ways[joint]]:
        raise InputError(path, f"{len(loose) + 1} roots", "the skin's joints must hang on one of them")
    wanted = {node: ways[joint][: k + 1] for joint in joints for k, node in enumerate(ways[joint])}
    below = [node for node, way in wanted.items() if top in way]
    return sorted(below, key=lambda node: (len(wanted[node]), node))


def _worlds(nodes: list[dict[str, Any]], parent: dict[int, int]) -> list[np.ndarray]:
    """(4, 4) of every node at rest."""
    found: dict[int, np.ndarray] = {}

    def world(i: int) -> np.ndarray:
        """The world matrix (4, 4) of node i, through its parents."""
        if i not in found:
            found[i] = (world(parent[i]) if i in parent else np.eye(4)) @ _matrix(nodes[i])
        return found[i]

    return [world(i) for i in range(len(nodes))]


def _matrix(node: dict[str, Any]) -> np.ndarray:
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    result = np.eye(4)
    result[:3, :3] = unitquat_to_rotmat(np.array(node.get("rotation", [0, 0, 0, 1.0]))) * node.get("scale", [1, 1, 1])
    result[:3, 3] = node.get("translation", [0, 0, 0])
    return result


def _as_parts(node: dict[str, Any]) -> None:
    """Animated nodes must have translation, rotation and scale in place of a matrix (glTF 2.0, 3.6.2)."""
    if "matrix" in node:
        matrix = _matrix(node)
        del node["matrix"]
        node["translation"] = matrix[:3, 3].tolist()
        node["rotation"] = rotmat_to_unitquat(_rotation(matrix)).tolist()
        node["scale"] = np.linalg.norm(matrix[:3, :3], axis=0).tolist()


def _rotation(matrix: np.ndarray) -> np.ndarray:
    return matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
