"""Writing BVH files: rotation channels Z X Y, the root's position, and positions of joints that also move."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from motionary.errors import InputError
from motionary.files import write_bytes
from motionary.formats.bvh_text import Node, render
from motionary.formats.tracks import to_locals
from motionary.motion import Motion
from motionary.motion.rotations import unitquat_to_euler_zxy

_POSITIONS = [("position", axis) for axis in range(3)]
_ROTATIONS = [("rotation", axis) for axis in (2, 0, 1)]  # z x y, as most programs write


def write_bvh(motion: Motion, path: str | os.PathLike, unit: float = 0.01, force: bool = True) -> Path:
    """Write a BVH file with rotation channels Z X Y, the root's position, and positions of joints that also move.

    Without rotations they are fitted, and bones become constant (`motionary.motion.fit_rotations`).

    Args:
        motion: what to write.
        path: where.
        unit: metres per unit of the file; centimetres by default, which most programs expect.
        force: replace an existing file.

    Raises:
        InputError: the place cannot be written, or unit is not a positive number.
    """
    if not (np.isfinite(unit) and unit > 0):
        raise InputError("unit", unit, "must be metres per unit, above 0")
    local = to_locals(motion)
    skeleton = local.skeleton
    inner = set(skeleton.parents)
    nodes: list[Node] = []
    columns: list[list[np.ndarray]] = []
    angles = np.degrees(unitquat_to_euler_zxy(local.rotations))
    for j, (name, parent) in enumerate(zip(skeleton.joints, skeleton.parents, strict=True)):
        # What was read from an End Site becomes one again; a joint of such a name that turns stays a joint.
        end = parent >= 0 and name == f"{skeleton.joints[parent]}_end" and j not in inner and not local.moving[j]
        end = end and bool(np.any(skeleton.offsets[j])) and np.abs(local.rotations[:, j, :3]).max() < 1e-6
        node = Node(_one_word(name), parent, end, tuple(float(x) for x in skeleton.offsets[j] / unit))
        columns.append([])
        if local.moving[j]:
            node.channels += _POSITIONS
            columns[j].append(local.translations[:, j] / unit)
        if not end:
            node.channels += _ROTATIONS
            columns[j].append(angles[:, j])
        nodes.append(node)
    values = [part for j in _depth_first(skeleton.parents) for part in columns[j]]
    text = render(nodes, 1 / motion.fps, np.concatenate(values, axis=1))
    return write_bytes(path, text, force)


def _one_word(name: str) -> str:
    """A joint's name as a BVH file can hold it: in one line, without braces."""
    return " ".join(name.replace("{", "(").replace("}", ")").split()) or "joint"


def _depth_first(parents: Sequence[int]) -> list[int]:
    """Joint indices in the order in which a BVH file nests them."""
    order, stack = [], [0]
    while stack:
        order.append(joint := stack.pop())
        stack += [j for j in range(len(parents) - 1, 0, -1) if parents[j] == joint]
    return order
