"""A `Plan`: what a body does over time, as smooth control curves, before any joint is placed.

Every segment starts and ends in the same standing pose, so that segments follow each other without a seam.
Sides are indexed 0 = left, 1 = right; angles are radians. Conventions of the channels:

* pelvis, spine, head: (pitch forward, lean to the left, twist to the left);
* arms: (flexion forward, abduction sideways, external twist of the upper arm, elbow flexion);
* feet: the ball of the foot in world coordinates, its yaw, and its pitch (heel up is positive);
* legs: (weight, hip flexion, hip abduction, knee flexion) of a leg that swings free of its planted foot.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from motionary.corpus.demo.curves import RATE, ease, frames_of, rotate_y

LEFT, RIGHT = 0, 1


@dataclass
class Plan:
    """Control curves over N planning frames (RATE per second); see the module for the channels."""

    path: np.ndarray  # (N, 2) root x and z on the floor, m
    yaw: np.ndarray  # (N,) heading
    height: np.ndarray  # (N,) pelvis height relative to standing, m
    sway: np.ndarray  # (N, 2) pelvis off the path in the body's frame: (to the left, forward), m
    pelvis: np.ndarray  # (N, 3)
    spine: np.ndarray  # (N, 3)
    head: np.ndarray  # (N, 3)
    arms: np.ndarray  # (N, 2, 4)
    ball: np.ndarray  # (N, 2, 3)
    foot_yaw: np.ndarray  # (N, 2)
    foot_pitch: np.ndarray  # (N, 2)
    legs: np.ndarray  # (N, 2, 4)
    contact: np.ndarray  # (N, 2) bool: the ball of the foot stands still on the floor

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.path)

    @property
    def seconds(self) -> float:
        """From the first frame to the last."""
        return (self.frames - 1) / RATE


@dataclass(frozen=True)
class Stance:
    """How a body stands: the pose between actions.

    Attributes:
        width: half the distance of the feet, m.
        forward: how far the balls of the feet stand before the pelvis, m.
        toe_out: outward yaw of each foot.
        height: pelvis height relative to straight legs, m (not positive).
        pelvis, spine, head: (3,) posture angles.
        arms: (4,) resting arm angles, the same on both sides.
    """

    width: float
    forward: float
    toe_out: float
    height: float
    pelvis: tuple[float, float, float]
    spine: tuple[float, float, float]
    head: tuple[float, float, float]
    arms: tuple[float, float, float, float]


def standing(stance: Stance, seconds: float) -> Plan:
    """The standing pose held for `seconds` at the origin, facing +z."""
    n = frames_of(seconds)
    hold = lambda value: np.repeat(np.asarray(value, dtype=np.float64)[None], n, axis=0)  # noqa: E731
    balls = [[stance.width, 0.0, stance.forward], [-stance.width, 0.0, stance.forward]]
    return Plan(
        path=np.zeros((n, 2)),
        yaw=np.zeros(n),
        height=np.full(n, stance.height),
        sway=np.zeros((n, 2)),
        pelvis=hold(stance.pelvis),
        spine=hold(stance.spine),
        head=hold(stance.head),
        arms=hold([stance.arms, stance.arms]),
        ball=hold(balls),
        foot_yaw=hold([stance.toe_out, -stance.toe_out]),
        foot_pitch=np.zeros((n, 2)),
        legs=np.zeros((n, 2, 4)),
        contact=np.ones((n, 2), dtype=bool),
    )


def _placed(plan: Plan, path: np.ndarray, yaw: float) -> Plan:
    """The plan moved to a start (x, z) and a start heading."""
    turn = rotate_y(np.asarray(yaw))
    flat = turn[np.ix_([0, 2], [0, 2])]
    ball = plan.ball @ turn.T
    ball[..., [0, 2]] += path
    return replace(plan, path=plan.path @ flat.T + path, yaw=plan.yaw + yaw, ball=ball, foot_yaw=plan.foot_yaw + yaw)


def follow(*plans: Plan) -> Plan:
    """Plans one after another, each starting where the one before it ended."""
    placed = [plans[0]]
    for plan in plans[1:]:
        last = placed[-1]
        moved = _placed(plan, last.path[-1], float(last.yaw[-1]))
        # An arm that went full circle goes on from where it is, not back by a turn.
        moved.arms = moved.arms + 2 * np.pi * np.round((last.arms[-1] - moved.arms[0]) / (2 * np.pi))
        placed.append(Plan(**{f.name: getattr(moved, f.name)[1:] for f in fields(Plan)}))
    return Plan(**{f.name: np.concatenate([getattr(p, f.name) for p in placed]) for f in fields(Plan)})


def overlay(base: Plan, gesture: Plan, start: float) -> Plan:
    """`base` with the arms, spine and head of `gesture` from `start` seconds on; legs and path stay those of base.

    An arm is taken over only as far as the gesture moves it away from standing.
    """
    begin = round(start * RATE)
    n = min(gesture.frames, base.frames - begin)
    span = slice(begin, begin + n)
    rest = gesture.arms[0]
    moved = np.abs(gesture.arms[:n] - rest).max(axis=-1)  # (n, 2)
    # An arm fades over within the first quarter radian: beyond it the gesture alone speaks.
    weight = ease(moved / 0.25)
    weight = np.maximum(weight, (np.abs(gesture.arms[:n] - rest).max(axis=(0, 2)) > 0.25) * _inside(n))[..., None]
    arms = base.arms.copy()
    arms[span] = (1 - weight) * base.arms[span] + weight * gesture.arms[:n]
    spine, head = base.spine.copy(), base.head.copy()
    spine[span] += gesture.spine[:n] - gesture.spine[0]
    head[span] += gesture.head[:n] - gesture.head[0]
    return replace(base, arms=arms, spine=spine, head=head)


def _inside(n: int) -> np.ndarray:
    """(n, 1) weight that is one except near both ends, where it fades over a quarter second."""
    t = np.arange(n) / RATE
    return (ease(t / 0.25) * ease((t[-1] - t) / 0.25))[:, None]


def sample(plan: Plan, fps: float) -> Plan:
    """The same curves at another rate: linear between planning frames, from 0 to the plan's end."""
    count = int(np.floor(plan.seconds * fps + 1e-6)) + 1
    at = np.minimum(np.arange(count) * (RATE / fps), plan.frames - 1)
    low = np.minimum(at.astype(int), max(plan.frames - 2, 0))
    part = at - low
    high = np.minimum(low + 1, plan.frames - 1)

    def pick(values: np.ndarray) -> np.ndarray:
        """Values at the new times; of flags, those that hold on both sides."""
        if values.dtype == bool:
            return values[low] & values[high]
        w = part.reshape((-1,) + (1,) * (values.ndim - 1))
        return (1 - w) * values[low] + w * values[high]

    return Plan(**{f.name: pick(getattr(plan, f.name)) for f in fields(Plan)})
