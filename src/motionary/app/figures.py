"""A motion as nodes of a visitor's scene: the limbs of its skeleton."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from motionary.formats.render.figure import COLORS, segments
from motionary.motion import Motion
from motionary.motion.rotations import rotmat_to_unitquat, vectors_to_rotmat

LOOKS = ("mannequin", "skeleton")  # the usual one first
_SIDES = 10


class Figure(Protocol):
    """Something in the scene that can take the pose of any frame."""

    def pose(self, frame: int) -> None:
        """Moves to a frame."""
        ...

    def remove(self) -> None:
        """Takes it out of the scene."""
        ...


class Limbs:
    """Cylinders and balls: all limbs of a motion are two nodes, so that a frame is three small messages."""

    def __init__(self, scene: Any, name: str, motion: Motion, shift: np.ndarray):
        positions = motion.positions.astype(np.float64) + shift
        begins, ends, radii, sides = segments(motion.skeleton, positions)
        along = ends - begins
        length = np.linalg.norm(along, axis=-1)
        radius, colors = radii.mean(-1), COLORS[sides].astype(np.uint8)
        turns = rotmat_to_unitquat(vectors_to_rotmat(np.array([0.0, 1.0, 0.0]), along))
        self.turns = np.roll(turns, 1, axis=-1).astype(np.float32)  # viser wants w first
        self.middles = ((begins + ends) / 2).astype(np.float32)
        self.tips = np.concatenate([begins, ends], axis=1).astype(np.float32)
        scales = np.stack([radius, np.median(length, axis=0), radius], -1)
        tube, ball = _tube(), _ball()
        self.tubes = scene.add_batched_meshes_simple(
            f"{name}/limbs", *tube, self.turns[0], self.middles[0], batched_scales=scales, batched_colors=colors,
            lod="off",
        )  # fmt: skip
        still = np.tile(np.array([1, 0, 0, 0], np.float32), (2 * len(radius), 1))
        self.balls = scene.add_batched_meshes_simple(
            f"{name}/joints", *ball, still, self.tips[0], batched_scales=np.concatenate([radii[:, 0], radii[:, 1]]),
            batched_colors=np.concatenate([colors, colors]), lod="off",
        )  # fmt: skip

    def pose(self, frame: int) -> None:
        """Moves to a frame."""
        self.tubes.batched_positions = self.middles[frame]
        self.tubes.batched_wxyzs = self.turns[frame]
        self.balls.batched_positions = self.tips[frame]

    def remove(self) -> None:
        """Takes it out of the scene."""
        self.tubes.remove()
        self.balls.remove()


def _tube() -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of an open cylinder along y, of radius and length one."""
    angle = np.linspace(0, 2 * np.pi, _SIDES, endpoint=False)
    ring = np.stack([np.cos(angle), np.zeros(_SIDES), np.sin(angle)], -1)
    up = np.array([0, 0.5, 0])
    vertices = np.concatenate([ring - up, ring + up])
    a = np.arange(_SIDES)
    b = (a + 1) % _SIDES
    faces = np.concatenate([np.stack([a, a + _SIDES, b], -1), np.stack([b, a + _SIDES, b + _SIDES], -1)])
    return vertices.astype(np.float32), faces.astype(np.uint32)


def _ball(rings: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a ball of radius one."""
    up, around = np.meshgrid(
        np.linspace(-np.pi / 2, np.pi / 2, rings + 1), np.linspace(0, 2 * np.pi, _SIDES, endpoint=False), indexing="ij"
    )
    vertices = np.stack([np.cos(up) * np.cos(around), np.sin(up), np.cos(up) * np.sin(around)], -1).reshape(-1, 3)
    row, a = np.meshgrid(np.arange(rings), np.arange(_SIDES), indexing="ij")
    b, row = (a + 1) % _SIDES, row * _SIDES
    first = np.stack([row + a, row + a + _SIDES, row + b], -1)
    second = np.stack([row + b, row + a + _SIDES, row + b + _SIDES], -1)
    return vertices.astype(np.float32), np.concatenate([first, second]).reshape(-1, 3).astype(np.uint32)
