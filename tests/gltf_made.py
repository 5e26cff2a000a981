"""glTF files as other programs write them, made by hand for tests."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np

from motionary.formats.gltf_container import packed
from motionary.motion.rotations import (
    quat_action,
    quat_conjugation,
    quat_product,
    rotvec_to_unitquat,
    unitquat_to_rotmat,
)

COMPONENTS = {"f4": 5126, "i2": 5122, "u1": 5121, "i1": 5120, "u2": 5123}
TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


class Made:
    """A document that arrays and channels are added to."""

    def __init__(self, nodes: list[dict[str, Any]], generator: str = "another program"):
        self.data = bytearray()
        self.document: dict[str, Any] = {"asset": {"version": "2.0", "generator": generator}, "nodes": nodes}
        self.document |= {"accessors": [], "bufferViews": [], "animations": []}

    def array(self, values: np.ndarray, dtype: str = "f4", **more: Any) -> int:
        """The index of a new accessor."""
        data = np.ascontiguousarray(values, f"<{dtype}")
        self.data += b"\0" * (-len(self.data) % 4)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": data.nbytes}
        self.data += data.tobytes()
        self.document["bufferViews"].append(view)
        width = 1 if data.ndim == 1 else data.shape[1]
        accessor = {"bufferView": len(self.document["bufferViews"]) - 1, "componentType": COMPONENTS[dtype]}
        self.document["accessors"].append(accessor | {"count": len(data), "type": TYPES[width]} | more)
        return len(self.document["accessors"]) - 1

    def channel(self, node: int, path: str, times: Any, values: Any, how: str = "LINEAR", **more: Any) -> None:
        """Adds a channel to the last animation."""
        if not self.document["animations"]:
            self.animation("take")
        last = self.document["animations"][-1]
        output = self.array(np.asarray(values), **more)
        last["channels"].append({"sampler": len(last["samplers"]), "target": {"node": node, "path": path}})
        last["samplers"].append({"input": self.array(np.asarray(times)), "output": output, "interpolation": how})

    def animation(self, name: str) -> None:
        """Begins an animation."""
        self.document["animations"].append({"name": name, "channels": [], "samplers": []})

    def glb(self, path: Path) -> Path:
        """Writes a .glb."""
        self.document["buffers"] = [{"byteLength": len(self.data)}]
        path.write_bytes(packed(self.document, bytes(self.data)))
        return path

    def gltf(self, path: Path, beside: str | None = None) -> Path:
        """Writes a .gltf with its buffer inside, or in a file beside it."""
        uri = beside or "data:application/octet-stream;base64," + base64.b64encode(bytes(self.data)).decode()
        if beside is not None:
            (path.parent / beside).write_bytes(bytes(self.data))
        self.document["buffers"] = [{"byteLength": len(self.data), "uri": uri}]
        path.write_text(json.dumps(self.document))
        return path


def character(motion: Any, prefix: str = "", seed: int = 0, posed: bool = False, inside: bool = False) -> Made:
    """A motion on a rig whose bones have axes of their own, in centimetres, z up, under a turned and scaled armature.

    Args:
        motion: with rotations.
        prefix: of the joints' names.
        seed: of the bones' axes.
        inside: the skin is bound in the axes and unit inside the armature, not in the world's.
        posed: the nodes stand in the first frame's pose, and the inverse bind matrices alone tell the bind.
    """
    skeleton, frames = motion.skeleton, motion.frames
    rng = np.random.default_rng(seed)
    up = rotvec_to_unitquat(np.array([np.pi / 2, 0, 0]))  # z of the armature's inside is y outside
    world = rotvec_to_unitquat(rng.normal(size=(len(skeleton), 3)))  # of the bones in the bind
    parents = list(skeleton.parents)
    rotations = motion.rotations.astype(np.float64)
    root = 100 * quat_action(quat_conjugation(up), motion.positions[:, 0].astype(np.float64))
    nodes: list[dict[str, Any]] = []
    local = np.empty((frames, len(skeleton), 4))
    for j, p in enumerate(parents):
        above = up if p < 0 else world[p]
        rest = quat_product(quat_conjugation(above), world[j])
        local[:, j] = quat_product(quat_product(quat_conjugation(above), rotations[:, j]), world[j])
        place = root[0] if p < 0 else 100 * quat_action(quat_conjugation(above), skeleton.offsets[j].astype(float))
        turn = local[0, j] if posed else rest
        nodes.append({"name": prefix + skeleton.joints[j], "translation": place.tolist(), "rotation": turn.tolist()})
    for j, p in enumerate(parents[1:], 1):
        nodes[p].setdefault("children", []).append(j)
    nodes.append({"name": "Armature", "children": [0], "rotation": up.tolist(), "scale": [0.01] * 3})
    made = Made(nodes)
    times = np.arange(frames) / motion.fps
    made.channel(0, "translation", times, root)
    for j in range(len(skeleton)):
        made.channel(j, "rotation", times, local[:, j])
    matrices = np.tile(np.eye(4), (len(skeleton), 1, 1))
    matrices[:, :3, :3] = unitquat_to_rotmat(world) * 0.01
    matrices[:, :3, 3] = skeleton.rest
    if inside:
        armature = np.eye(4)
        armature[:3, :3] = unitquat_to_rotmat(up) * 0.01
        matrices = np.linalg.inv(armature) @ matrices
    inverse = np.linalg.inv(matrices).transpose(0, 2, 1).reshape(-1, 16)
    made.document["skins"] = [{"joints": list(range(len(skeleton))), "inverseBindMatrices": made.array(inverse)}]
    return made
