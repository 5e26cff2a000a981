"""What to draw of a skeleton: a few tapered limbs with a side, shared by video, page and mesh."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from motionary.motion import Skeleton

# Radii in metres (at the limb's begin and end) of a body whose legs measure 0.8 m, by the role of the limb's end.
_RADII = {
    "hip": (0.085, 0.088),
    "knee": (0.074, 0.052),
    "ankle": (0.050, 0.036),
    "foot": (0.038, 0.028),
    "spine1": (0.095, 0.098),
    "spine2": (0.098, 0.100),
    "spine3": (0.100, 0.100),
    "neck": (0.070, 0.048),
    "head": (0.048, 0.048),
    "collar": (0.060, 0.055),
    "shoulder": (0.055, 0.056),
    "elbow": (0.043, 0.037),
    "wrist": (0.036, 0.026),
}
_PLAIN = (0.028, 0.022)
# Ends that reach beyond their last joint: (radius, how far along the last bone's direction).
_CAPS = {"head": (0.090, 0.070), "wrist": (0.032, 0.075), "foot": (0.030, 0.03)}
_ENOUGH = 12  # roles that a rig must know for its helpers and fingers to be left out
LEFT, MIDDLE, RIGHT = 0, 1, 2
COLORS = np.array([[232, 116, 88], [122, 131, 150], [62, 140, 200]], np.float32)  # by side: coral, slate, blue


@dataclass(frozen=True)
class Limb:
    """A tapered capsule between two joints; `reach` metres beyond `end` where it caps a chain (then from `end`)."""

    begin: int
    end: int
    radii: tuple[float, float]
    side: int
    reach: float = 0.0


@lru_cache(maxsize=64)
def limbs(skeleton: Skeleton) -> tuple[Limb, ...]:
    """The limbs to draw: of a known rig only the joints that play a role, of any other rig every bone."""
    roles = {joint: role for role, joint in skeleton.roles.items()}
    if len(roles) < _ENOUGH:
        return _plain(skeleton)
    size = _size(skeleton)
    found = []
    for joint, role in roles.items():
        begin = skeleton.parents[joint]
        while begin >= 0 and begin not in roles:
            begin = skeleton.parents[begin]
        if begin < 0:
            continue
        part = role.removeprefix("left_").removeprefix("right_")
        side = LEFT if role.startswith("left_") else RIGHT if role.startswith("right_") else MIDDLE
        if part in ("hip", "collar", "shoulder"):
            side = MIDDLE
        a, b = _RADII.get(part, _PLAIN)
        found.append(Limb(begin, joint, (a * size, b * size), side))
        if part in _CAPS:
            radius, reach = (x * size for x in _CAPS[part])
            found.append(Limb(begin, joint, (radius, radius * (1.0 if part == "head" else 0.75)), side, reach))
    return tuple(found)


def _size(skeleton: Skeleton) -> float:
    """Thickness relative to a body with legs of 0.8 m."""
    roles = skeleton.roles
    legs = [f"{side}_{part}" for side in ("left", "right") for part in ("knee", "ankle")]
    known = [roles[role] for role in legs if role in roles] or [j for j in roles.values() if j]
    return float(np.clip(skeleton.bone_lengths[known].mean() / 0.4, 0.2, 5.0))


def _plain(skeleton: Skeleton) -> tuple[Limb, ...]:
    side = dict.fromkeys((left for left, _ in skeleton.pairs), LEFT) | dict.fromkeys(
        (right for _, right in skeleton.pairs), RIGHT
    )
    lengths = skeleton.bone_lengths
    size = max(float(lengths.sum()) / max(len(lengths) - 1, 1) / 0.18, 1e-3)
    return tuple(
        Limb(p, j, (_PLAIN[0] * size, _PLAIN[1] * size), side.get(j, MIDDLE))
        for j, p in enumerate(skeleton.parents)
        if p >= 0
    )


def segments(skeleton: Skeleton, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Limbs in space.

    Args:
        positions: (..., J, 3) metres.

    Returns:
        begins and ends (..., L, 3), radii (L, 2) in metres and sides (L,).
    """
    parts = limbs(skeleton)
    begin, end = (np.array([getattr(part, name) for part in parts], int) for name in ("begin", "end"))
    reach = np.array([part.reach for part in parts])[:, None]
    a, b = positions[..., begin, :], positions[..., end, :]
    along = (b - a) / np.maximum(np.linalg.norm(b - a, axis=-1, keepdims=True), 1e-6)
    cap = reach > 0
    radii = np.array([part.radii for part in parts]).reshape(-1, 2)
    return np.where(cap, b + along * reach * 0.35, a), b + along * reach, radii, np.array([p.side for p in parts], int)
