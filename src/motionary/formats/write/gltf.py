"""Animated glTF 2.0 (.glb): the skeleton as nodes, its rotations and movement, and a skinned body."""

from __future__ import annotations

import json
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np

from motionary.files import writable, write_bytes
from motionary.formats.animated_rig import place
from motionary.formats.gltf_file import GENERATOR
from motionary.formats.render.mesh import Body, capsules, mannequin, rest_positions
from motionary.formats.tracks import Locals, to_locals
from motionary.motion import Motion
from motionary.motion.rotations import quat_continuation, unitquat_to_rotmat

_STILL = 1e-7
# Numbers that glTF 2.0 gives to kinds of data (5.1.3, 5.11.5). Its JSON is plain enough to be written as it is; a
# library of classes for it took longer to import than a file takes to write (the tests read files through one).
_COMPONENTS = {np.float32: 5126, np.uint8: 5121, np.uint16: 5123, np.uint32: 5125}
_VERTICES, _INDICES = 34962, 34963


def write_glb(motion: Motion, path: str | os.PathLike, mesh: bool = True, force: bool = True) -> Path:
    """Write a motion as .glb: y up, metres, one animation named ``motion``.

    Rotations are the motion's own, or fitted (then bones are constant). Where a joint other than the root also
    moves, its node is translated too, so that joints lie where the motion has them.

    Args:
        motion: what to write.
        path: where.
        mesh: with a skinned body: a mannequin on rigs like SMPL's, capsules on others.
        force: replace an existing file.

    Raises:
        InputError: see `write_motion`.
    """
    writable(path, force)
    return write_bytes(path, glb_bytes(motion, mesh), force)


def glb_bytes(motion: Motion, mesh: bool = True) -> bytes:
    """The contents of a .glb file (see `write_glb`): glTF 2.0's JSON and one binary buffer, in its container."""
    local = to_locals(motion)
    pack = _Pack()
    skeleton = local.skeleton
    nodes: list[dict[str, Any]] = [
        {"name": name, "translation": [float(x) for x in skeleton.offsets[j]]} for j, name in enumerate(skeleton.joints)
    ]
    for j, p in enumerate(skeleton.parents[1:], 1):
        nodes[p].setdefault("children", []).append(j)
    nodes[0]["translation"] = [float(x) for x in local.translations[0, 0]]
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": GENERATOR, "extras": {"fps": motion.fps}},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
    }
    document["animations"] = [_animation(local, motion.fps, nodes, pack)]
    if mesh:
        _add_body(document, *_body(local), pack)
    document |= {"accessors": pack.accessors, "bufferViews": pack.views, "buffers": [{"byteLength": len(pack.data)}]}
    text = json.dumps(document, separators=(",", ":")).encode()
    chunks = ((b"JSON", text + b" " * (-len(text) % 4)), (b"BIN\0", bytes(pack.data)))
    body = b"".join(struct.pack("<I", len(data)) + kind + data for kind, data in chunks)
    return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body


class _Pack:
    """Arrays in one binary buffer, each with its view and accessor."""

    def __init__(self):
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, array: np.ndarray, target: int | None = None, bounds: bool = False, normalized: bool = False) -> int:
        """The index of a new accessor for (N,), (N, 2..4) or (N, 4, 4)."""
        kind = {(): "SCALAR", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}[array.shape[1:]]
        data = np.ascontiguousarray(array).tobytes()
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)}
        self.views.append(view if target is None else {**view, "target": target})
        self.data += data + b"\0" * (-len(data) % 4)
        component = _COMPONENTS[array.dtype.type]
        accessor = {"bufferView": len(self.views) - 1, "componentType": component, "count": len(array), "type": kind}
        if normalized:
            accessor["normalized"] = True
        if bounds:
            flat = array.reshape(len(array), -1)
            accessor["min"], accessor["max"] = flat.min(0).tolist(), flat.max(0).tolist()
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def _animation(local: Locals, fps: float, nodes: list[dict[str, Any]], pack: _Pack) -> dict[str, Any]:
    channels: list[dict[str, Any]] = []
    samplers: list[dict[str, Any]] = []
    frames = len(local.rotations)
    time = pack.add((np.arange(frames) / fps).astype(np.float32), bounds=True)

    def channel(joint: int, path: str, values: np.ndarray) -> None:
        """Adds one animated property of a joint."""
        channels.append({"sampler": len(samplers), "target": {"node": joint, "path": path}})
        samplers.append({"input": time, "output": pack.add(values.astype(np.float32)), "interpolation": "LINEAR"})

    # q and -q are one rotation: keep neighbours on one side, so that blending between frames takes the short way.
    rotations = quat_continuation(local.rotations)
    for j, node in enumerate(nodes):
        if local.moving[j]:
            channel(j, "translation", local.translations[:, j])
        if j == 0 or np.ptp(rotations[:, j], axis=0).max() > _STILL:
            channel(j, "rotation", rotations[:, j])
        else:
            node["rotation"] = rotations[0, j].tolist()
    return {"name": "motion", "channels": channels, "samplers": samplers}


def _body(local: Locals) -> tuple[Body, np.ndarray]:
    """The body and the inverse bind matrices (J, 4, 4) of its joints, row-major."""
    skeleton = local.skeleton
    inverse = np.tile(np.eye(4), (len(skeleton.joints), 1, 1))
    if (figure := mannequin(skeleton)) is not None:
        inverse[:, :3, 3] = -rest_positions(skeleton)
        return figure, inverse
    # Rest poses of other rigs can be anything (all bones along one axis): bind to the first frame instead.
    positions, rotations = place(skeleton.parents, local.rotations[:1], local.translations[:1])
    back = unitquat_to_rotmat(rotations[0]).transpose(0, 2, 1)
    inverse[:, :3, :3] = back
    inverse[:, :3, 3] = -(back @ positions[0, :, :, None])[..., 0]
    return capsules(skeleton, positions[0]), inverse


def _add_body(document: dict[str, Any], mesh: Body, inverse: np.ndarray, pack: _Pack) -> None:
    """A mesh node skinned to the joint nodes."""
    joints = len(inverse)
    bind = inverse.transpose(0, 2, 1).astype(np.float32)  # glTF stores columns
    # Vertex colours of glTF are linear light; ours are sRGB as on screen.
    linear = ((mesh.colors / 255.0) ** 2.2 * 255).round().astype(np.uint8)
    opaque = np.full((len(linear), 1), 255, np.uint8)
    attributes = {
        "POSITION": pack.add(mesh.vertices, _VERTICES, bounds=True),
        "NORMAL": pack.add(mesh.normals, _VERTICES),
        "COLOR_0": pack.add(np.hstack([linear, opaque]), _VERTICES, normalized=True),
        "JOINTS_0": pack.add(mesh.joints.astype(np.uint8) if joints <= 256 else mesh.joints, _VERTICES),
        "WEIGHTS_0": pack.add(mesh.weights, _VERTICES),
    }
    small = np.uint16 if len(mesh.vertices) < 65535 else np.uint32
    indices = pack.add(mesh.faces.astype(small).reshape(-1), _INDICES)
    surface = {"baseColorFactor": [1.0] * 4, "metallicFactor": 0.0, "roughnessFactor": 0.75}
    document["materials"] = [{"name": "body", "pbrMetallicRoughness": surface}]
    document["meshes"] = [{"primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}]
    document["skins"] = [{"joints": list(range(joints)), "skeleton": 0, "inverseBindMatrices": pack.add(bind)}]
    document["nodes"].append({"name": "body", "mesh": 0, "skin": 0})
    document["scenes"] = [{"nodes": [0, len(document["nodes"]) - 1]}]
