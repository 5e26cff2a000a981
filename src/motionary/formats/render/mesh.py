"""Skinned bodies for a skeleton: a wooden mannequin where its joints allow it, else capsules."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from motionary.formats.render.figure import COLORS, limbs, segments
from motionary.motion import Skeleton
from motionary.motion.rotations import vectors_to_rotmat

_WOOD = np.array([205, 170, 125], np.float32)
_SIDES = 12  # of a capsule
_RINGS = 4  # of each of its caps
_LONGEST_STRETCH = 2.5
_WIDEST_TURN = np.cos(np.radians(50))


@dataclass(frozen=True)
class Body:
    """A triangle mesh bound to joints.

    Attributes:
        vertices, normals: (V, 3) float32, metres, in the pose to which they are bound.
        faces: (F, 3) uint32.
        joints: (V, 4) uint16 joint indices; weights: (V, 4) float32, summing to one.
        colors: (V, 3) uint8.
    """

    vertices: np.ndarray
    normals: np.ndarray
    faces: np.ndarray
    joints: np.ndarray
    weights: np.ndarray
    colors: np.ndarray


def rest_positions(skeleton: Skeleton) -> np.ndarray:
    """(J, 3) joints of the rest pose, the root at the origin."""
    rest = np.zeros((len(skeleton.joints), 3))
    for j, p in enumerate(skeleton.parents[1:], 1):
        rest[j] = rest[p] + skeleton.offsets[j]
    return rest


@lru_cache(maxsize=1)
def _wooden() -> tuple[list[str], np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """mannequin-x's figure on the SMPL joints: roles, parents, joints (22, 3), vertices, faces, weights (V, 22)."""
    from mannequin import Mannequin

    model = Mannequin("wooden")
    pose = model.rest_pose()
    places = model.joint_transforms(pose)[:, :3, 3].astype(np.float64)
    parents = np.array(model.parents)
    main = np.arange(len(parents))
    for j in range(22, len(parents)):  # fingers move with their wrist
        main[j] = main[parents[j]]
    indices, shares = model._skin_joint_indices, model._skin_weights
    assert indices is not None
    assert shares is not None
    count = model.num_vertices
    flat = np.arange(count)[:, None] * 22 + main[indices]
    weights = np.bincount(flat.ravel(), shares.ravel(), count * 22).reshape(count, 22)
    roles = [name.replace("L_", "left_").replace("R_", "right_").lower() for name in model.joint_names[:22]]
    return roles, parents[:22], places[:22], model.vertices(pose).astype(np.float64), np.asarray(model.faces), weights


@lru_cache(maxsize=16)
def mannequin(skeleton: Skeleton) -> Body | None:
    """A wooden figure in the skeleton's rest pose, its root at the origin; each part is turned and stretched to it.

    Returns:
        None if the skeleton lacks one of the 22 SMPL roles, or its rest pose differs much from SMPL's.
    """
    roles, parents, places, vertices, faces, weights = _wooden()
    if not set(roles) <= skeleton.roles.keys():
        return None
    joints = np.array([skeleton.roles[role] for role in roles])
    rest = rest_positions(skeleton)[joints]
    old, new = (points[1:] - points[parents[1:]] for points in (places, rest))
    old_length, new_length = np.linalg.norm(old, axis=-1), np.linalg.norm(new, axis=-1)
    stretch = new_length / old_length
    if stretch.min() < 1 / _LONGEST_STRETCH or stretch.max() > _LONGEST_STRETCH:
        return None
    if ((old * new).sum(-1) / (old_length * new_length)).min() < _WIDEST_TURN:
        return None
    girth = float(np.sqrt(np.median(stretch)))
    moved = np.zeros_like(vertices)
    for k in range(22):
        children = [c for c in range(1, 22) if parents[c] == k]
        shape = np.eye(3) * girth
        if children:  # of several children the middle one (spine, neck) gives the direction
            child = min(children, key=lambda c: abs(places[c, 0] - places[k, 0]))
            shape = _align(places[child] - places[k], rest[child] - rest[k], girth)
        own = np.flatnonzero(weights[:, k])  # a vertex follows four joints at most
        moved[own] += weights[own, k, None] * (rest[k] + (vertices[own] - places[k]) @ shape.T)
    top = np.argpartition(-weights, 3, axis=1)[:, :4]
    share = np.take_along_axis(weights, top, axis=1)
    share /= share.sum(1, keepdims=True)
    colors = np.broadcast_to(_WOOD, moved.shape)
    return _body(moved, faces, np.where(share > 0, joints[top], 0), share, colors)


def _align(old: np.ndarray, new: np.ndarray, girth: float) -> np.ndarray:
    """The matrix that turns bone `old` to `new` and stretches along it, with `girth` across."""
    axis = old / np.linalg.norm(old)
    along = np.linalg.norm(new) / np.linalg.norm(old)
    return vectors_to_rotmat(old, new) @ (girth * np.eye(3) + (along - girth) * np.outer(axis, axis))


def capsules(skeleton: Skeleton, positions: np.ndarray) -> Body:
    """One tapered capsule per limb at joints (J, 3); its halves follow the joints that move its two ends."""
    begins, ends, radii, sides = segments(skeleton, positions.astype(np.float64))
    ring = np.linspace(0, np.pi / 2, _RINGS, endpoint=True)
    # Latitudes from one pole to the other; the sign says to which end a ring belongs.
    lift = np.concatenate([-np.cos(ring), np.sin(ring)])
    wide = np.concatenate([np.sin(ring), np.cos(ring)])
    turn = np.linspace(0, 2 * np.pi, _SIDES, endpoint=False)
    unit = np.stack(np.broadcast_arrays(wide[:, None] * np.cos(turn), wide[:, None] * np.sin(turn), lift[:, None]), -1)
    at_end = (np.arange(2 * _RINGS) >= _RINGS)[:, None]
    first = _strip_faces(2 * _RINGS)
    vertices, faces, joints, colors = [], [], [], []
    for i, limb in enumerate(limbs(skeleton)):
        frame = _frame(ends[i] - begins[i])
        centre = np.where(at_end, ends[i], begins[i])[:, None]
        radius = np.where(at_end, radii[i, 1], radii[i, 0])[..., None]
        faces.append(first + len(vertices) * unit.shape[0] * _SIDES)
        vertices.append((centre + radius * (unit @ frame)).reshape(-1, 3))
        mover = (limb.end, limb.end) if limb.reach else (limb.begin, skeleton.parents[limb.end])
        joints.append(np.repeat(np.where(at_end[:, 0], mover[1], mover[0]), _SIDES))
        colors.append(np.broadcast_to(COLORS[sides[i]], vertices[-1].shape))
    bound = np.zeros((sum(map(len, joints)), 4), int)
    bound[:, 0] = np.concatenate(joints)
    weights = np.zeros(bound.shape)
    weights[:, 0] = 1
    return _body(np.concatenate(vertices), np.concatenate(faces), bound, weights, np.concatenate(colors))


def _strip_faces(rings: int) -> np.ndarray:
    ring, side = np.meshgrid(np.arange(rings - 1), np.arange(_SIDES), indexing="ij")
    a, b = ring * _SIDES + side, ring * _SIDES + (side + 1) % _SIDES
    return np.stack([np.stack([a, b, b + _SIDES], -1), np.stack([a, b + _SIDES, a + _SIDES], -1)], 2).reshape(-1, 3)


def _frame(axis: np.ndarray) -> np.ndarray:
    """(3, 3) rows: an orthonormal frame whose last row is `axis`."""
    length = np.linalg.norm(axis)
    z = axis / length if length > 1e-9 else np.array([0.0, 1.0, 0.0])
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def _body(vertices: np.ndarray, faces: np.ndarray, joints: np.ndarray, weights: np.ndarray, colors: np.ndarray) -> Body:
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    area = np.cross(b - a, c - a)
    normals = np.stack([np.bincount(faces.ravel(), area[:, i].repeat(3), len(vertices)) for i in range(3)], -1)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    normals[np.abs(normals).sum(-1) < 0.5] = [0, 1, 0]
    return Body(
        vertices.astype(np.float32),
        normals.astype(np.float32),
        faces.astype(np.uint32),
        joints.astype(np.uint16),
        weights.astype(np.float32),
        np.asarray(colors).astype(np.uint8),
    )
