"""A moving body without unit: the joints that play a role, in lengths of leg and trunk, at some instants."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from motionary.motion.rigs import REQUIRED

_INSTANTS = 100  # enough to judge by; long takes cost no more than short ones
_STEP = 0.1  # s over which speeds are taken
_FALL_RATE = 20.0  # instants a second at which falls are looked for
_MOST_WOBBLE = 0.25  # real bones keep their length; points whose bones vary more than this are no body


@dataclass(frozen=True)
class BodyFrame:
    """What the measurements look at.

    Attributes:
        size: leg (hip to ankle) and trunk (hips to shoulders) together, in the file's unit.
        places: (T, R, 3) the joints with a role, in sizes.
        speeds: (T, R) sizes per second.
        velocity: (T, 3) of the pelvis, sizes per second.
        roles: index into R by role.
        rest: (R, 3) the rest pose in the same axes and unit, where the file has one.
        solid: whether bones keep their length, as a body's do.
        pull: (n, 3) accelerations of the body's middle over the whole motion, sizes per second squared; (0, 3) where
            the rate is too low to see a fall.
    """

    size: float
    places: np.ndarray
    speeds: np.ndarray
    velocity: np.ndarray
    roles: Mapping[str, int]
    rest: np.ndarray | None
    solid: bool
    pull: np.ndarray

    def __getitem__(self, role: str) -> np.ndarray:
        """(T, 3) places of a joint."""
        return self.places[:, self.roles[role]]

    def middle(self, part: str) -> np.ndarray:
        """(T, 3) between the left and the right joint of a kind."""
        return (self[f"left_{part}"] + self[f"right_{part}"]) / 2

    def both(self, part: str) -> np.ndarray:
        """(T, 2, 3) the left and the right joint of a kind."""
        return self.places[:, [self.roles[f"left_{part}"], self.roles[f"right_{part}"]]]

    @cached_property
    def across(self) -> np.ndarray:
        """(T, 3) unit vectors from the right side to the left one."""
        return unit(self["left_hip"] - self["right_hip"] + self["left_shoulder"] - self["right_shoulder"])

    @property
    def at_rest(self) -> BodyFrame | None:
        """The rest pose as a body of one instant."""
        if self.rest is None:
            return None
        still = np.zeros((1, len(self.rest)))
        nothing = np.zeros((0, 3))
        return BodyFrame(self.size, self.rest[None], still, np.zeros((1, 3)), self.roles, None, self.solid, nothing)


def body_of(
    positions: np.ndarray, roles: Mapping[str, int], fps: float, rest: np.ndarray | None = None
) -> BodyFrame | None:
    """The body of joint positions (T, J, 3) in any unit and axes; None where roles are missing or have no extent.

    Args:
        positions: of all joints.
        roles: joint by role.
        fps: frames per second.
        rest: (J, 3) rest pose, where there is one.
    """
    if not all(role in roles for role in REQUIRED):
        return None
    frames = len(positions)
    step = min(max(1, round(min(fps, 1e4) * _STEP)), max(frames - 1, 0))
    at = np.unique(np.linspace(0, max(frames - 1 - step, 0), min(_INSTANTS, max(1, frames - step))).astype(int))
    joints = list(roles.values())
    index = {role: i for i, role in enumerate(roles)}
    now = positions[at[:, None], joints].astype(np.float64)
    lengths = _bones(now, index)
    ordered = np.sort(lengths, axis=0)
    low, usual, high = (ordered[round(share * (len(ordered) - 1)), :4] for share in (0.1, 0.5, 0.9))
    size = float(usual.sum() / 2 + ordered[round(0.8 * (len(ordered) - 1)), 4])
    if not (np.isfinite(size) and size > 0 and usual.min() > 1e-3 * size):
        return None
    now /= size
    later = positions[(at + step)[:, None], joints] / size
    velocity = (later - now) * (fps / max(step, 1))
    return BodyFrame(
        size,
        now,
        np.linalg.norm(velocity, axis=-1),
        velocity[:, index["pelvis"]],
        index,
        None if rest is None else rest[joints] / size,
        bool(((high - low) / usual).max() < _MOST_WOBBLE),
        _pull(positions, [joints[index[role]] for role in REQUIRED], fps) / size,
    )


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) of length 1; those without length stay 0."""
    return vectors / np.maximum(np.sqrt(np.einsum("...i,...i->...", vectors, vectors))[..., None], 1e-9)


def rank(values: np.ndarray, share: float) -> np.ndarray:
    """The value (n,) below which a share of the rows (T, n) lies: by rank, since percentiles take ten times as long."""
    return np.sort(values, axis=0)[round(share * (len(values) - 1))]


def _pull(positions: np.ndarray, joints: list[int], fps: float) -> np.ndarray:
    """(n, 3) second differences of the joints' mean, about 20 a second, in units per second squared."""
    stride = max(1, round(fps / _FALL_RATE))
    if fps / stride < 0.7 * _FALL_RATE or len(positions) < 3 * stride:
        return np.zeros((0, 3))
    middle = positions[::stride].take(joints, axis=1).mean(axis=1, dtype=np.float64)
    return np.diff(middle, 2, axis=0) * (fps / stride) ** 2


def _bones(places: np.ndarray, roles: Mapping[str, int]) -> np.ndarray:
    """(T, 5) lengths of both thighs, both shins and the trunk."""
    at = {role: places[:, i] for role, i in roles.items()}
    pairs = [
        (at[f"{s}_{a}"], at[f"{s}_{b}"]) for a, b in (("hip", "knee"), ("knee", "ankle")) for s in ("left", "right")
    ]
    hips, shoulders = ((at[f"left_{part}"] + at[f"right_{part}"]) / 2 for part in ("hip", "shoulder"))
    return np.stack([np.linalg.norm(a - b, axis=-1) for a, b in [*pairs, (hips, shoulders)]], axis=-1)
