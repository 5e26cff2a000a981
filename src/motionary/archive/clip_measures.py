"""What tells a broken clip from a sound one, as numbers: of any rig whose thirteen main joints are known."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from motionary.errors import InputError
from motionary.motion import Motion
from motionary.motion.facing import rotate_y
from motionary.motion.rigs import REQUIRED

_AT = {role: place for place, role in enumerate(REQUIRED)}
_SIDES = ("left", "right")
_BONES = [
    (_AT[f"{side}_{above}"], _AT[f"{side}_{below}"])
    for side in _SIDES
    for above, below in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))
]
_NEAR_GROUND = 0.25  # m above the lowest joint's usual level: what lies lower may carry the body
_OUT = np.cos(np.radians(30))  # arms are out while within 30 degrees of the line through the shoulders
_FEWEST = 6  # frames that differences need


def measured(motion: Motion) -> dict[str, float]:
    """The measures of a clip by name; those that need more frames than it has are left out.

    - size: leg and trunk together, m.
    - reach, pose: range (2.5th to 97.5th percentile) of the joint that moves most, in the room and seen by the body, m.
    - arms_out: share of frames with both arms out to the sides.
    - bone_jump: largest departure of a limb's length from its median, m.
    - turn, turn_at: the fastest turn of the line through hips and shoulders, in degrees between frames a 20th of a
      second apart or less, and when it happens, s.
    - jump, jump_at: the largest departure of a step of the pelvis from the steps before and after it, m, and when, s.
    - spike, spike_at: the largest departure of any joint from a smooth path, m, and when, s; spikiness: the same by the
      usual departure.
    - noise: departure from a smooth path in a usual frame and of a quiet joint, m; roughness: the same divided by how
      much all paths bend.
    - slide: speed over the ground that even the stillest low joint has in nine tenths of the frames, m/s.
    - pace: usual speed of the pelvis over the ground, m/s.

    Raises:
        InputError: a main joint of the rig is not known.
    """
    missing = [role for role in REQUIRED if role not in motion.skeleton.roles]
    if missing:
        raise InputError(f"skeleton {motion.skeleton.name}", ", ".join(missing), "these joints must be known")
    body = _Body(motion.positions[:, [motion.skeleton.roles[role] for role in REQUIRED]].astype(np.float64), motion.fps)
    found = _shape(body) | _range(body)
    if len(body.joints) >= _FEWEST:
        found |= _breaks(body) | _noise(body) | _ground(body)
    return {name: float(value) for name, value in found.items()}


@dataclass(frozen=True)
class _Body:
    """(T, 13, 3) main joints and their rate."""

    joints: np.ndarray
    fps: float

    def of(self, role: str) -> np.ndarray:
        """(T, 3) a joint's way."""
        return self.joints[:, _AT[role]]

    def middle(self, part: str) -> np.ndarray:
        """(T, 3) between the left and the right joint of a kind."""
        return (self.of(f"left_{part}") + self.of(f"right_{part}")) / 2

    @cached_property
    def across(self) -> np.ndarray:
        """(T, 3) unit vectors from right to left, of hips and shoulders together."""
        line = sum(self.of(f"left_{part}") - self.of(f"right_{part}") for part in ("hip", "shoulder"))
        return _unit(np.asarray(line))

    @cached_property
    def pose(self) -> np.ndarray:
        """(T, 13, 3) joints from the pelvis, the body facing one way."""
        angle = np.arctan2(-self.across[:, 2], self.across[:, 0])[:, None]
        return rotate_y(self.joints - self.joints[:, :1], -angle)

    @cached_property
    def off_path(self) -> np.ndarray:
        """(T - 4, 13) m between a joint and the cubic through the two frames before and the two after."""
        x = self.joints
        smooth = (4 * (x[1:-3] + x[3:-1]) - x[:-4] - x[4:]) / 6
        return np.linalg.norm(x[2:-2] - smooth, axis=-1)


def _shape(body: _Body) -> dict[str, float]:
    above, below = np.array(_BONES).T
    lengths = np.linalg.norm(body.joints[:, above] - body.joints[:, below], axis=-1)
    usual = np.median(lengths, axis=0)
    trunk = np.linalg.norm(body.middle("hip") - body.middle("shoulder"), axis=-1)
    legs = usual[[0, 1, 4, 5]].sum() / 2
    return {"size": legs + np.percentile(trunk, 80), "bone_jump": np.abs(lengths - usual).max()}


def _range(body: _Body) -> dict[str, float]:
    across = body.of("left_shoulder") - body.of("right_shoulder")
    out = [
        _cosine(body.of(f"{side}_{below}") - body.of(f"{side}_{above}"), across * sign)
        for side, sign in zip(_SIDES, (1, -1), strict=True)
        for above, below in (("shoulder", "elbow"), ("elbow", "wrist"))
    ]
    arms_out = (np.minimum.reduce(out) > _OUT).mean()
    return {"reach": _extent(body.joints), "pose": _extent(body.pose), "arms_out": arms_out}


def _breaks(body: _Body) -> dict[str, float]:
    stride = max(1, round(body.fps / 20))
    cosine = (body.across[stride:] * body.across[:-stride]).sum(-1)
    turn = np.degrees(np.arccos(cosine.clip(-1, 1)))
    steps = np.diff(body.of("pelvis"), axis=0)
    jump = np.linalg.norm(steps[1:-1] - (steps[:-2] + steps[2:]) / 2, axis=-1)
    spike = body.off_path.max(axis=1)
    found = {"spikiness": spike.max() / (np.percentile(body.off_path, 95) + 0.005)}
    for name, values, first in (("turn", turn, 1), ("jump", jump, 2), ("spike", spike, 2)):
        if len(values):
            found |= {name: values.max(), f"{name}_at": (values.argmax() + first) / body.fps}
    return found


def _noise(body: _Body) -> dict[str, float]:
    usual = np.median(body.off_path, axis=0)
    bends = np.median(np.linalg.norm(np.diff(body.joints, 2, axis=0), axis=-1))
    return {"noise": np.sort(usual)[3], "roughness": np.median(body.off_path) / (bends + 2e-4)}


def _ground(body: _Body) -> dict[str, float]:
    height = body.joints[..., 1] - np.percentile(body.joints[..., 1].min(axis=1), 5)
    low = (height[1:] < _NEAR_GROUND) & (height[:-1] < _NEAR_GROUND)
    speed = np.linalg.norm(np.diff(body.joints[..., [0, 2]], axis=0), axis=-1) * body.fps
    stillest = np.where(low, speed, np.inf).min(axis=1)
    stillest = stillest[np.isfinite(stillest)]
    slide = np.percentile(stillest, 10) if len(stillest) >= _FEWEST else 0.0
    return {"slide": slide, "pace": np.median(speed[:, _AT["pelvis"]])}


def _extent(points: np.ndarray) -> float:
    low, high = np.percentile(points, [2.5, 97.5], axis=0)
    return float(np.linalg.norm(high - low, axis=-1).max())


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)


def _cosine(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (_unit(a) * _unit(b)).sum(-1)
