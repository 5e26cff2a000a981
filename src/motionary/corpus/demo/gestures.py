"""Actions of arms and hands: wave, raise, punch, clap, point, throw, swing.

An arm pose is (flexion forward, abduction sideways, external twist, elbow flexion); see `plan`.
"""

from __future__ import annotations

import numpy as np

from motionary.corpus.demo.acts import Act
from motionary.corpus.demo.curves import RATE, curve, ease
from motionary.corpus.demo.plan import LEFT, RIGHT, Plan, standing
from motionary.corpus.demo.styles import Mood

GUARD = (0.75, 0.22, -0.35, 2.0)


def _level(mood: Mood) -> float:
    """How far a stooped chest tips forward: an arm that aims at the world must lift by as much more."""
    return mood.stance.spine[0] + mood.stance.pelvis[0]


class Keys:
    """Key poses of one or both arms, written one after the other: `to(seconds, pose)`, `back(seconds)`."""

    def __init__(self, mood: Mood, start: float = 0.15):
        self.mood, self.rest = mood, np.array(mood.stance.arms)
        self.times, self.poses = [0.0, start], [self.rest, self.rest]

    def to(self, seconds: float, pose) -> float:
        """Reach `pose` after `seconds` at the mood's tempo; returns the time reached."""
        self.times.append(self.times[-1] + self.mood.seconds(seconds))
        self.poses.append(np.asarray(pose, dtype=float))
        return self.times[-1]

    def hold(self, seconds: float) -> float:
        """Stay in the last pose."""
        return self.to(seconds, self.poses[-1])

    def back(self, seconds: float) -> float:
        """Return to rest."""
        return self.to(seconds, self.rest)

    @property
    def end(self) -> float:
        """When the last key stands, in seconds."""
        return self.times[-1]

    def at(self, t: np.ndarray) -> np.ndarray:
        """(N, 4) arm angles."""
        return curve(t, self.times, np.stack(self.poses))


def _standing(mood: Mood, end: float) -> tuple[Plan, np.ndarray]:
    plan = standing(mood.stance, end + 0.2)
    return plan, np.arange(plan.frames) / RATE


def _lean_in(plan: Plan, t: np.ndarray, sides: tuple[int, ...], start: float, end: float, size: float) -> None:
    """A small counter-lean and shift of weight while one arm is up (in place)."""
    if len(sides) == 2:
        return
    sign = 1 if sides[0] == LEFT else -1
    active = ease((t - start) / 0.6) * ease((end - t) / 0.6)
    plan.spine[:, 1] -= sign * size * active
    plan.sway[:, 0] -= sign * 0.025 * active


def wave(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Lift one hand or both above the head and wave `count` times (three where none is given)."""
    big = np.clip(mood.amplitude, 0.75, 1.25)
    keys = Keys(mood)
    tilt = 0.25 + 0.8 * _level(mood)
    upper, twist = 2.1 + float(rng.uniform(-0.06, 0.1)), 1.35
    keys.to(0.6, (tilt, upper, twist, 0.75))
    waves = act.count or 3
    for _ in range(waves):
        keys.to(0.32, (tilt, upper, twist, 0.75 + 0.6 * big))
        keys.to(0.32, (tilt, upper, twist, 0.75 - 0.5 * big))
    keys.to(0.15, (tilt, upper, twist, 0.8))
    keys.back(0.65)
    plan, t = _standing(mood, keys.end)
    for side in act.sides:
        plan.arms[:, side] = keys.at(t)
    _lean_in(plan, t, act.sides, 0.1, keys.end, 0.06)
    return plan


def lift_arm(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Raise one arm or both above the head and lower them again, `count` times."""
    high = 2.85 + float(rng.uniform(-0.12, 0.1))
    front = min(high + max(_level(mood), 0.0), 3.3)
    sideways = bool(rng.integers(2)) and len(act.sides) == 2
    top = (0.15 + 0.7 * _level(mood), high, 0.6, 0.12) if sideways else (front, 0.16, 0.0, 0.12)
    keys = Keys(mood)
    for k in range(act.times):
        keys.to(0.75, top)
        keys.hold(0.35 + 0.25 * float(rng.random()))
        if k < act.times - 1:
            keys.to(0.7, 0.9 * keys.rest + 0.1 * np.array(top))
    keys.back(0.8)
    plan, t = _standing(mood, keys.end)
    for side in act.sides:
        plan.arms[:, side] = keys.at(t)
    _lean_in(plan, t, act.sides, 0.1, keys.end, 0.05)
    plan.head[:, 0] -= 0.15 * ease((t - 0.15) / 0.7) * ease((keys.end - t) / 0.7)
    return plan


def punch(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """From a guard, punch forward with one fist `count` times, or with both in turn."""
    begin = mood.seconds(0.55)
    beat = mood.seconds(0.62)
    first = int(rng.integers(2))
    order = [(first + k) % 2 if len(act.sides) == 2 else act.sides[0] for k in range(act.times)]
    end = begin + beat * act.times + mood.seconds(0.65)
    plan, t = _standing(mood, end)
    guard = ease((t - 0.1) / (begin - 0.1)) * ease((end - t) / mood.seconds(0.6))
    rest = plan.arms.copy()
    out = np.zeros((plan.frames, 2))
    for k, side in enumerate(order):
        start = begin + k * beat
        out[:, side] += curve(t, [start, start + 0.2 * beat, start + 0.45 * beat, start + beat], [0, -0.12, 1, 0])
    reach = np.array((1.5 + _level(mood), -0.06, -0.35, 0.08))
    for side in (LEFT, RIGHT):
        pose = np.array(GUARD) + out[:, side, None] * (reach - GUARD)
        plan.arms[:, side] = rest[:, side] + guard[:, None] * (pose - rest[:, side])
    twist = mood.amplitude * (out[:, RIGHT] - out[:, LEFT])
    plan.spine[:, 2] += 0.38 * twist
    plan.pelvis[:, 2] += 0.16 * twist
    plan.head[:, 2] -= 0.45 * twist
    plan.spine[:, 0] += 0.1 * guard + 0.06 * np.abs(twist)
    plan.sway[:, 1] += 0.035 * np.abs(twist)
    plan.height -= 0.05 * guard
    return plan


def clap(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Clap the hands before the chest `count` times."""
    big = np.clip(mood.amplitude, 0.75, 1.25)
    high = 0.75 + max(_level(mood), 0.0) + float(rng.uniform(-0.05, 0.1))
    together = (high, 0.0, -0.72, 1.3)
    apart = (high, 0.25, -0.72 + 0.62 * big, 1.3)
    keys = Keys(mood)
    keys.to(0.5, apart)
    for _ in range(act.times):
        keys.to(0.2, together)
        keys.to(0.26, apart)
    keys.back(0.55)
    plan, t = _standing(mood, keys.end)
    for side in (LEFT, RIGHT):
        plan.arms[:, side] = keys.at(t)
    return plan


def point(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Point forward or to the side with one arm and hold it."""
    level = 1.5 + float(rng.uniform(-0.05, 0.08))
    aim = (level + _level(mood), 0.02, 0.0, 0.04) if act.direction == "forward" else (0.08, level, 0.4, 0.04)
    keys = Keys(mood)
    keys.to(0.6, aim)
    keys.hold(0.9 + 0.5 * float(rng.random()))
    keys.back(0.7)
    plan, t = _standing(mood, keys.end)
    side = act.sides[0]
    plan.arms[:, side] = keys.at(t)
    active = ease((t - 0.15) / 0.6) * ease((keys.end - t) / 0.6)
    if act.direction == "side":
        plan.head[:, 2] += (1 if side == LEFT else -1) * 0.8 * active
        plan.spine[:, 2] += (1 if side == LEFT else -1) * 0.12 * active
    _lean_in(plan, t, act.sides, 0.1, keys.end, 0.04)
    return plan


def throw(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Wind up and throw overarm with one hand, `count` times."""
    side = act.sides[0]
    sign = 1 if side == LEFT else -1
    keys = Keys(mood)
    twists, times = [0.0, 0.0], [0.0, 0.15]
    for _ in range(act.times):
        times.append(keys.to(0.6, (-0.25, 1.6, 1.45, 1.75)))
        twists.append(sign * 0.55)
        times.append(keys.to(0.12, (0.0, 1.65, 1.5, 1.65)))
        twists.append(sign * 0.6)
        keys.to(0.16, (1.7, 0.55, 0.5, 0.7))
        times.append(keys.to(0.14, (1.25, 0.05, -0.2, 0.15)))
        twists.append(-sign * 0.5)
        times.append(keys.to(0.25, (0.55, -0.1, -0.3, 0.3)))
        twists.append(-sign * 0.45)
    times.append(keys.back(0.5))
    twists.append(0.0)
    plan, t = _standing(mood, keys.end)
    plan.arms[:, side] = keys.at(t)
    twist = curve(t, times, twists) * np.clip(mood.amplitude, 0.75, 1.2)
    plan.spine[:, 2] += 0.75 * twist
    plan.pelvis[:, 2] += 0.3 * twist
    plan.head[:, 2] -= 0.75 * twist
    forward = np.maximum(-sign * twist, 0)
    plan.spine[:, 0] += 0.45 * forward - 0.15 * np.maximum(sign * twist, 0)
    plan.sway[:, 1] += 0.08 * forward - 0.06 * np.maximum(sign * twist, 0)
    plan.arms[:, 1 - side, 0] += 0.6 * np.maximum(sign * twist, 0)
    plan.arms[:, 1 - side, 1] += 0.25 * np.abs(twist)
    plan.height -= 0.05 * np.abs(twist)
    return plan


def swing_arm(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Swing one arm or both in full circles, `count` times, forward (up in front) or backward."""
    turn = 2 * np.pi * (1 if act.direction == "forward" else -1)
    each = mood.seconds(0.85)
    begin = 0.2
    end = begin + each * act.times + mood.seconds(0.5)
    plan, t = _standing(mood, end)
    # Constant speed inside, half a turn's worth of easing at either end.
    speed = ease((t - begin) / (0.5 * each)) * ease((end - t) / (0.5 * each))
    turned = np.cumsum(speed)
    angle = turn * act.times * turned / turned[-1]
    active = ease((t - begin) / 0.4) * ease((end - t) / 0.4)
    for side in act.sides:
        plan.arms[:, side, 0] += angle
        plan.arms[:, side, 1] += active * (0.2 - plan.arms[:, side, 1])
        plan.arms[:, side, 2] -= active * plan.arms[:, side, 2]
        plan.arms[:, side, 3] += active * (0.08 - plan.arms[:, side, 3])
    # A full turn of flexion is the resting arm again.
    plan.spine[:, 0] += 0.06 * active * np.sin(angle)
    if len(act.sides) == 1:
        plan.spine[:, 2] += (1 if act.sides[0] == RIGHT else -1) * 0.12 * active * np.sin(angle)
    return plan
