"""The mannequins of one visitor's scene: taken, posed, given back, and never removed.

The page of viser 1.1.1 dies where a skinned mesh is removed (its bones are taken from a node that is gone already). So
who gives one back leaves it hidden for the next motion on a like rig, which need not be sent again either.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from motionary.formats.animated_rig import place
from motionary.formats.render.mesh import Body, mannequin, rest_positions
from motionary.formats.tracks import Locals, to_locals
from motionary.motion import Motion, Skeleton

_ALIKE = 0.01  # metres between the bones of two rigs that one mesh may show: seams of that width
_SPARE = 6  # hidden meshes that keep their shape


class Mannequins:
    """The wooden figures of a scene, in use and hidden."""

    def __init__(self, scene: Any, under: str):
        """`under`: the name of the node that they stand in."""
        self._scene, self._under = scene, under
        self._hidden: list[_Mesh] = []
        self._made = 0

    def take(self, motion: Motion, shift: np.ndarray) -> Mannequin | None:
        """A figure of the motion, moved by `shift` (3,) metres; None where no mannequin fits the rig."""
        local = to_locals(motion)
        mesh = self._like(local.skeleton)
        if mesh is None:
            body = mannequin(local.skeleton)
            if body is None:
                return None
            self._retire()
            mesh = _Mesh(self._scene, f"{self._under}/mannequin{self._made}", local.skeleton, body)
            self._made += 1
        return Mannequin(mesh, local, shift, self._hidden.append)

    def _like(self, skeleton: Skeleton) -> _Mesh | None:
        """A hidden mesh of a rig whose bones differ by no more than a seam."""
        for mesh in self._hidden:
            if mesh.fits(skeleton):
                self._hidden.remove(mesh)
                return mesh
        return None

    def _retire(self) -> None:
        """Frees what the longest hidden one takes in the browser, where there are many."""
        if len(self._hidden) >= _SPARE:
            self._hidden.pop(0).empty()


class _Mesh:
    """A skinned mesh, and the rig whose bones it follows."""

    def __init__(self, scene: Any, name: str, skeleton: Skeleton, body: Body):
        self.bones = np.unique(body.joints[body.weights > 0])
        self._skeleton = skeleton
        place = np.zeros(len(skeleton.joints), int)
        place[self.bones] = np.arange(len(self.bones))
        weights = np.zeros((len(body.vertices), len(self.bones)), np.float32)
        rows = np.arange(len(weights))
        for k in range(body.joints.shape[1]):
            weights[rows, place[body.joints[:, k]]] += body.weights[:, k]
        self.node = scene.add_mesh_skinned(
            name, body.vertices, body.faces, bone_wxyzs=np.tile([1.0, 0.0, 0.0, 0.0], (len(self.bones), 1)),
            bone_positions=rest_positions(skeleton)[self.bones], skin_weights=weights,
            color=tuple(int(c) for c in body.colors[0]),
        )  # fmt: skip

    def fits(self, skeleton: Skeleton) -> bool:
        """Whether it can show motions of this rig too."""
        own = self._skeleton
        if (own.joints, own.parents) != (skeleton.joints, skeleton.parents):
            return False
        return bool(np.abs(own.offsets - skeleton.offsets).max() < _ALIKE)

    def empty(self) -> None:
        """Leaves one triangle of it."""
        self.node.faces = np.zeros((1, 3), np.uint32)
        self.node.vertices = self.node.vertices[:1]
        self.node.skin_indices, self.node.skin_weights = self.node.skin_indices[:1], self.node.skin_weights[:1]


class Mannequin:
    """A mesh that shows one motion."""

    def __init__(self, mesh: _Mesh, local: Locals, shift: np.ndarray, give_back: Any):
        positions, rotations = place(local.skeleton.parents, local.rotations, local.translations)
        self.mesh, self._give_back = mesh.node, lambda: give_back(mesh)
        self.positions = (positions + shift)[:, mesh.bones]
        self.rotations = np.roll(rotations[:, mesh.bones], 1, axis=-1)  # viser wants w first
        self.pose(0)
        self.mesh.visible = True

    def pose(self, frame: int) -> None:
        """Moves to a frame."""
        for bone, position, rotation in zip(self.mesh.bones, self.positions[frame], self.rotations[frame], strict=True):
            bone.position, bone.wxyz = position, rotation

    def remove(self) -> None:
        """Hides it, for another motion to take."""
        self.mesh.visible = False
        self._give_back()
