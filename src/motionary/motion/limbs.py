"""Legs of a rig by its roles, and their turning with all that hangs on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from motionary.motion.feet import two_bone
from motionary.motion.rotations import vectors_to_rotmat
from motionary.motion.skeleton import Skeleton

SIDES = ("left", "right")


@dataclass(frozen=True)
class Leg:
    """Joint indices of one leg.

    Attributes:
        hip, knee, ankle, toe: of the roles; no toe on rigs that stand on their ankles.
        thigh, shin, foot: joints that turn with each: itself, twist bones, a heel; the toes turn on their own.
        bones: joints from below the hip to the ankle.
    """

    hip: int
    knee: int
    ankle: int
    toe: int | None
    thigh: tuple[int, ...]
    shin: tuple[int, ...]
    foot: tuple[int, ...]
    bones: tuple[int, ...]

    @property
    def feet(self) -> list[int]:
        """Ankle and, where there is one, toe."""
        return [self.ankle] if self.toe is None else [self.ankle, self.toe]

    def reach(self, turned: np.ndarray, points: np.ndarray, goals: np.ndarray) -> None:
        """Turns hip, knee and ankle in global rotations (T, J, 3, 3) so that the foot comes to its goals.

        The foot turns as the line from ankle to toe does, and its toes keep their rotation in the world; without a toe
        all of the foot keeps it.

        Args:
            turned: changed in place.
            points: (T, J, 3) joint positions before.
            goals: (T, N, 3) of `feet`; of two that bones do not allow, the toe's is kept.
        """
        goal = goals[:, 0]
        if self.toe is not None:
            sole = points[:, self.toe] - points[:, self.ankle]
            turn = vectors_to_rotmat(sole, goals[:, 1] - goal)
            goal = goals[:, 1] - (turn @ sole[..., None])[..., 0]
            turned[:, self.foot] = turn[:, None] @ turned[:, self.foot]
        thigh, shin = two_bone(points[:, self.hip], points[:, self.knee], points[:, self.ankle], goal)
        turned[:, self.thigh] = thigh[:, None] @ turned[:, self.thigh]
        turned[:, self.shin] = shin[:, None] @ turned[:, self.shin]


def legs_of(skeleton: Skeleton) -> tuple[Leg, Leg] | None:
    """The left and the right leg; None where hips, knees or ankles are unknown."""
    roles = skeleton.roles
    if any(f"{side}_{part}" not in roles for side in SIDES for part in ("hip", "knee", "ankle")):
        return None
    left, right = (_leg(skeleton, side) for side in SIDES)
    return left, right


def _leg(skeleton: Skeleton, side: str) -> Leg:
    hip, knee, ankle = (skeleton.roles[f"{side}_{part}"] for part in ("hip", "knee", "ankle"))
    toe = skeleton.roles.get(f"{side}_foot")
    ends = [joint for joint in (hip, knee, ankle, toe) if joint is not None]
    of: dict[int, list[int]] = {joint: [] for joint in ends}
    for joint in range(hip, len(skeleton)):
        if (above := _nearest(skeleton.parents, joint, ends)) is not None:
            of[above].append(joint)
    bones, joint = [], ankle
    while joint != hip:
        bones.append(joint)
        joint = skeleton.parents[joint]
    return Leg(hip, knee, ankle, toe, tuple(of[hip]), tuple(of[knee]), tuple(of[ankle]), tuple(bones))


def _nearest(parents: Sequence[int], joint: int, among: Sequence[int]) -> int | None:
    """The joint itself or the nearest above it that is among some."""
    while joint >= 0 and joint not in among:
        joint = parents[joint]
    return joint if joint >= 0 else None
