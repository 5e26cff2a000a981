"""A motion written onto the rig of a BVH file: its nodes, their order and offsets, its channels, unit and axes."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from motionary.files import write_bytes
from motionary.formats.animated_rig import Track
from motionary.formats.bvh_text import Node, parse, render
from motionary.formats.dispatch import DAMAGED_RIG, about, foreseen
from motionary.formats.read.bvh import read_bvh, track_of
from motionary.motion import Motion
from motionary.motion.rigging import Rig, to_rig
from motionary.motion.rotations import rotmat_to_unitquat, unitquat_to_euler, unitquat_to_rotmat
from motionary.text_files import text_stream


def write_bvh_onto(motion: Motion, onto: str | os.PathLike, path: str | os.PathLike, force: bool = True) -> Path:
    """Write a motion as BVH on the rig of another BVH file, whose own motion is left out.

    Raises:
        InputError: the rig's file is not readable or lacks a role, or the place cannot be written.
    """
    with foreseen(onto, DAMAGED_RIG), about(onto):
        with text_stream(onto) as file:
            raw = parse(file, onto)
            track = track_of(raw)
        own = read_bvh(onto)
        rig = Rig.of(own.skeleton, own.rotations)
    moved = to_rig(motion, rig)
    return write_bytes(path, render(raw.nodes, 1 / motion.fps, _values(raw.nodes, track, moved)), force)


def _values(nodes: list[Node], track: Track, motion: Motion) -> np.ndarray:
    """The channels' values (T, C) in the file's unit and axes."""
    assert motion.rotations is not None
    skeleton = motion.skeleton
    place = {name: j for j, name in enumerate(skeleton.joints)}
    joints = iter(track.joints)
    # End sites without a length are no joints; a node that only carries the root is none of the skeleton's.
    names = [None if node.end and not np.any(node.offset or 0) else next(joints) for node in nodes]
    turn, unit = _axes_and_unit(track.joints, track.rest, motion)
    local = turn.T @ unitquat_to_rotmat(motion.rotations) @ turn
    root = motion.positions[:, 0].astype(np.float64) @ turn / unit
    columns = []
    for node, name in zip(nodes, names, strict=True):
        joint = place.get(name) if name is not None else None
        still = np.zeros(3) if joint is None and node.parent < 0 else np.array(node.offset or (0.0, 0.0, 0.0))
        moves = root if joint == 0 else np.broadcast_to(still, root.shape)
        axes = [axis for kind, axis in node.channels if kind == "rotation"]
        angles = np.zeros((motion.frames, 3))
        if joint is not None and axes:
            order = axes + [axis for axis in range(3) if axis not in axes]
            angles = np.unwrap(unitquat_to_euler(order, rotmat_to_unitquat(local[:, joint])), axis=0)
        turns = iter(np.degrees(angles).T)
        columns += [next(turns) if kind == "rotation" else moves[:, axis] for kind, axis in node.channels]
    return np.stack(columns, axis=1)


def _axes_and_unit(names: tuple[str, ...], offsets: np.ndarray, motion: Motion) -> tuple[np.ndarray, float]:
    """Axes (3, 3) that turn the file's vectors into the motion's, and metres per unit of the file."""
    place = {name: j for j, name in enumerate(names)}
    same = [(place[name], j) for j, name in enumerate(motion.skeleton.joints) if name in place and j]
    theirs = offsets[[i for i, _ in same]]
    ours = motion.skeleton.offsets[[j for _, j in same]].astype(np.float64)
    unit = float(np.linalg.norm(ours) / np.linalg.norm(theirs))
    covariance = ours.T @ (theirs * unit)
    u, _, vt = np.linalg.svd(covariance + 1e-6 * np.trace(ours.T @ ours) * np.eye(3))
    return u @ vt, unit
