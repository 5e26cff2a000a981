"""Steps: feet that stand still while they carry, and swing in arcs between their footholds.

A gait is a root path and a rhythm. Every foothold lies under the point of the path that the body passes in the middle
of the foot's stance, so that one planner serves walking, running, turning, circling and walking backwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from motionary.corpus.demo.curves import RATE, curve, ease, smooth, times_of
from motionary.corpus.demo.plan import LEFT, RIGHT, Plan, standing
from motionary.corpus.demo.styles import Mood


@dataclass(frozen=True)
class Step:
    """One swing of one foot: when, and where its ball lands (x, z in metres, yaw)."""

    side: int
    start: float
    end: float
    target: tuple[float, float]
    yaw: float
    arc: float = 0.07
    roll: float = 0.45  # heel-up pitch when the foot leaves the floor
    early: float = 0.15  # seconds before the swing at which the heel starts to rise
    kick_up: float = 1.0  # further pitch factor in early swing (a runner's heel comes up behind)


def take_steps(plan: Plan, steps: Sequence[Step]) -> None:
    """Write steps into a plan's feet (in place), in order of time for each foot."""
    t = np.arange(plan.frames) / RATE
    for step in steps:
        side = step.side
        swing = (t >= step.start) & (t <= step.end)
        after = t > step.end
        s = (t[swing] - step.start) / (step.end - step.start)
        first = int(np.argmax(swing))
        origin, from_yaw = plan.ball[first, side].copy(), plan.foot_yaw[first, side]
        goal = np.array([step.target[0], 0.0, step.target[1]])
        progress = ease(s)[:, None]
        plan.ball[swing, side] = origin + progress * (goal - origin)
        plan.ball[swing, side, 1] = curve(s, [0, 0.4, 0.75, 1], np.array([0, 1, 0.45, 0]) * step.arc)
        plan.ball[after, side] = goal
        plan.foot_yaw[swing, side] = from_yaw + progress[:, 0] * (step.yaw - from_yaw)
        plan.foot_yaw[after, side] = step.yaw
        d = step.end - step.start
        keys = [step.start - step.early, step.start, step.start + 0.22 * d, step.start + 0.78 * d, step.end]
        pitch = [0, step.roll, step.roll * 1.15 * step.kick_up, -0.3 * min(step.roll, 0.6), 0]
        rolling = (t >= keys[0]) & (t <= step.end)
        plan.foot_pitch[rolling, side] = curve(t[rolling], keys, pitch)
        plan.contact[(t > step.start) & (t < step.end), side] = False


def beside(path: np.ndarray, yaw: float, side: int, mood: Mood) -> tuple[float, float]:
    """Where the ball of a foot stands for a root at `path` (x, z) with heading `yaw`."""
    left = mood.stance.width * (1 if side == LEFT else -1)
    forward = mood.stance.forward
    sine, cosine = np.sin(yaw), np.cos(yaw)
    return float(path[0] + cosine * left + sine * forward), float(path[1] - sine * left + cosine * forward)


@dataclass(frozen=True)
class Rhythm:
    """How steps follow each other.

    Attributes:
        cycle: seconds from a foot's landing to its next.
        stance: share of the cycle that a foot stands (below one half there is flight).
        arc, roll, kick_up, early: see `Step` (early as a share of the cycle).
        bob: half the rise of the pelvis within a step, m.
        phase: the pelvis is highest this share of a step after the swing's start.
        arms: half the swing of the arms, rad; elbow: their added flexion.
        lean: forward pitch of the trunk under way.
        brake: steps over which the body comes to a halt.
    """

    cycle: float
    stance: float
    arc: float = 0.07
    roll: float = 0.45
    kick_up: float = 1.0
    early: float = 0.18
    bob: float = 0.018
    phase: float = 0.55
    arms: float = 0.35
    elbow: float = 0.1
    lean: float = 0.03
    brake: float = 1.2


def travel(mood: Mood, shape, steps: int, rhythm: Rhythm, lead: int) -> Plan:
    """Steps along a path, from standing to standing.

    Args:
        mood: of the performer.
        shape: function of progress (N,) in 0..1 to root positions (N, 2) in metres and headings (N,).
        steps: number of steps, at least two.
        rhythm: see `Rhythm`.
        lead: side of the first step.
    """
    half, swing = rhythm.cycle / 2, (1 - rhythm.stance) * rhythm.cycle
    begin = 0.15
    starts = begin + half * np.arange(steps)
    end = starts[-1] + swing
    plan = standing(mood.stance, end + 0.3)
    t = np.arange(plan.frames) / RATE
    whole = end - begin
    ramp, brake = min(max(half * 1.2, 0.35), 0.45 * whole), min(max(half * rhythm.brake, 0.35), 0.5 * whole)
    speed = ease((t - begin + 0.06) / ramp) * ease((end + 0.12 - t) / brake)
    progress = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))])
    plan.path[:], plan.yaw[:] = shape(progress / progress[-1])
    plans = []
    for i, start in enumerate(starts):
        land = start + swing
        # The last step of each foot lands where the body will stand.
        middle = (land + start + 2 * half) / 2 if i < steps - 2 else t[-1]
        at = min(round(middle * RATE), plan.frames - 1)
        side = (lead + i) % 2
        out = mood.stance.toe_out * (1 if side == LEFT else -1)
        target = beside(plan.path[at], float(plan.yaw[at]), side, mood)
        early = min(rhythm.early * rhythm.cycle, 0.9 * start)
        plans.append(
            Step(side, start, land, target, float(plan.yaw[at]) + out, rhythm.arc, rhythm.roll, early, rhythm.kick_up)
        )
    take_steps(plan, plans)
    _carry(plan, mood, rhythm, speed, (t - begin) / half)
    return plan


def _carry(plan: Plan, mood: Mood, rhythm: Rhythm, speed: np.ndarray, phase: np.ndarray) -> None:
    """Trunk and arms of a gait, driven by where the feet are (in place)."""
    style = mood.style
    forward = np.stack([np.sin(plan.yaw), np.cos(plan.yaw)], axis=-1)
    lead = np.einsum("nfc,nc->nf", plan.ball[..., [0, 2]] - plan.path[:, None], forward)
    stride = smooth(lead[:, LEFT] - lead[:, RIGHT], 0.08)
    # Amplitude follows stride; a foot is ahead by at most about 0.7 m in these gaits.
    ahead = np.tanh(stride / 0.45)
    active = smooth(speed, 0.1)
    # In flight gravity sets the bounce, so style changes it less.
    bounce = style.bounce if rhythm.stance > 0.5 else style.bounce**0.4
    bob = rhythm.bob * bounce * np.cos(2 * np.pi * (phase - rhythm.phase)) - 0.6 * rhythm.bob
    plan.height += active * bob
    support = smooth(plan.contact[:, LEFT].astype(float) - plan.contact[:, RIGHT], 0.16)
    plan.sway[:, 0] += 0.03 * support
    plan.pelvis[:, 1] += (0.04 + style.roll * 0.4) * support * active
    plan.spine[:, 1] += (style.roll * 0.6 - 0.03) * support * active
    plan.pelvis[:, 0] += active * rhythm.lean
    plan.spine[:, 0] += active * rhythm.lean * 0.6
    plan.pelvis[:, 2] += -0.12 * ahead
    plan.spine[:, 2] += 0.26 * ahead * style.swing
    plan.head[:, 2] += -0.12 * ahead * style.swing
    swing = rhythm.arms * style.swing * mood.amplitude * ahead
    for side, sign in ((LEFT, -1), (RIGHT, 1)):
        plan.arms[:, side, 0] += sign * swing - 0.1 * np.abs(swing)
        plan.arms[:, side, 3] += active * (rhythm.elbow + 0.5 * sign * swing + 0.25 * rhythm.arms)


def shift_weight(plan: Plan, side: int, start: float, end: float, share: float = 0.85, take: float = 0.35) -> None:
    """Bring the pelvis over one foot from `start` to `end` seconds, moving `take` seconds there and back (in place)."""
    t = times_of(plan.seconds)[: plan.frames]
    sign = 1 if side == LEFT else -1
    over = ease((t - start) / take) * ease((end - t) / take)
    plan.sway[:, 0] += sign * over * share * abs(plan.ball[0, side, 0])
    plan.pelvis[:, 1] += sign * 0.05 * over
    plan.spine[:, 1] -= sign * 0.04 * over
