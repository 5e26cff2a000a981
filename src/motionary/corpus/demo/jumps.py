"""Actions that leave the floor: jump, hop, jumping jack. In the air the body falls as gravity says."""

from __future__ import annotations

import numpy as np

from motionary.corpus.demo.acts import Act
from motionary.corpus.demo.curves import RATE, curve, ease
from motionary.corpus.demo.gait import beside, shift_weight
from motionary.corpus.demo.plan import LEFT, Plan, standing
from motionary.corpus.demo.styles import Mood

GRAVITY = 9.81
TIPTOE = 0.09  # how much the pelvis gains at take-off from the raised heels, m
ROLL = 0.85  # heel-up pitch at take-off, rad


class Bounces:
    """Times and pelvis heights of `count` leaps in a row: crouch, push, flight, landing, crouch, ..."""

    def __init__(self, count: int, leap: float, crouch: float, settle: float, slow: float, begin: float = 0.1):
        speed = float(np.sqrt(2 * GRAVITY * leap))
        self.air = 2 * speed / GRAVITY
        # A constant push from rest over the distance d to take-off speed v takes 2 d / v seconds.
        self.push = 2 * (crouch + TIPTOE) / speed
        self.soak = 2 * (settle + TIPTOE) / speed
        times, heights, slopes = [0.0, begin], [0.0, 0.0], [0.0, 0.0]
        self.takeoffs: list[float] = []
        self.landings: list[float] = []
        clock, down = begin, slow
        for k in range(count):
            clock += down
            times.append(clock)
            heights.append(-crouch)
            slopes.append(0.0)
            clock += self.push
            self.takeoffs.append(clock)
            self.landings.append(clock + self.air)
            times += [clock, clock + self.air]
            heights += [TIPTOE, TIPTOE]
            slopes += [speed, -speed]
            clock += self.air + self.soak
            times.append(clock)
            heights.append(-settle)
            slopes.append(0.0)
            down = 0.5 * slow if k < count - 1 else slow
        clock += 1.1 * slow
        self.end = clock
        self.times, self.heights, self.slopes = [*times, clock], [*heights, 0.0], [*slopes, 0.0]

    def height(self, t: np.ndarray) -> np.ndarray:
        """(N,) pelvis height relative to standing; a cubic with these ends and slopes is the parabola of free fall."""
        return curve(t, self.times, self.heights, self.slopes)

    def effort(self, t: np.ndarray) -> np.ndarray:
        """(N,) from 0 standing to 1 in the crouches, -0.5 in the air."""
        keys, values = [0.0], [0.0]
        for takeoff, landing in zip(self.takeoffs, self.landings, strict=True):
            keys += [takeoff - 1.25 * self.push, takeoff + 0.5 * self.air, landing + self.soak]
            values += [1.0, -0.5, 0.7]
        return curve(t, [*keys, self.end], [*values, 0.0])

    def flights(self):
        """(take-off, landing) seconds of every leap."""
        return zip(self.takeoffs, self.landings, strict=True)


def _fly(plan: Plan, bounces: Bounces, sides: tuple[int, ...], tuck: float) -> None:
    """Write the feet's roll, flight and landing (in place); their ground position follows the path already."""
    t = np.arange(plan.frames) / RATE
    for side in sides:
        for takeoff, landing in bounces.flights():
            air = landing - takeoff
            s = np.clip((t - takeoff) / air, 0, 1)
            flying = (t > takeoff) & (t < landing)
            plan.ball[flying, side, 1] += (0.5 * GRAVITY * air**2 * s * (1 - s) + tuck * 16 * (s * (1 - s)) ** 2)[
                flying
            ]
            early = min(0.2, bounces.push)
            keys = [takeoff - early, takeoff, takeoff + 0.3 * air, landing - 0.02, landing + min(0.12, bounces.soak)]
            near = (t >= keys[0]) & (t <= keys[-1])
            plan.foot_pitch[near, side] = curve(t[near], keys, [0, ROLL, ROLL * 0.9, 0.5, 0])
            plan.contact[flying, side] = False


def _leap_path(plan: Plan, bounces: Bounces, leap: np.ndarray, mood: Mood, sides: tuple[int, ...]) -> None:
    """Carry root and feet by `leap` (x, z) metres in every flight (in place)."""
    t = np.arange(plan.frames) / RATE
    before = plan.ball[0][:, [0, 2]].copy()
    keys, values = [0.0], [0.0]
    for k, (takeoff, landing) in enumerate(bounces.flights()):
        s = np.clip((t - takeoff) / (landing - takeoff), 0, 1)
        for side in sides:
            plan.ball[:, side, 0] += ease(s) * leap[0]
            plan.ball[:, side, 2] += ease(s) * leap[1]
        keys += [takeoff - 0.5 * bounces.push, landing + 0.5 * bounces.soak]
        values += [k, k + 1.0]
    progress = curve(t, keys, values)
    plan.path += progress[:, None] * leap
    for side in set((0, 1)) - set(sides):
        # A foot in the air travels with the body.
        plan.ball[:, side][:, [0, 2]] = before[side] + progress[:, None] * leap


def jump(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Jump with both feet, up or in a direction, `count` times, arms swinging."""
    lift = 0.2 * np.clip(mood.amplitude, 0.65, 1.2) * {None: 1.0, "slow": 0.8, "fast": 1.0}[act.speed]
    lift *= float(rng.uniform(0.9, 1.1))
    bounces = Bounces(act.times, lift, 0.24, 0.18, mood.seconds(0.42))
    plan = standing(mood.stance, bounces.end + 0.15)
    t = np.arange(plan.frames) / RATE
    plan.height += bounces.height(t)
    reach = 0.45 * np.clip(mood.amplitude, 0.7, 1.15)
    leap = {"forward": (0, 1), "backward": (0, -0.75), "left": (0.8, 0), "right": (-0.8, 0)}.get(act.direction or "up")
    if leap:
        _leap_path(plan, bounces, reach * np.array(leap, dtype=float), mood, (0, 1))
    _fly(plan, bounces, (0, 1), 0.1)
    effort = bounces.effort(t)
    crouch, air = np.maximum(effort, 0), np.maximum(-effort, 0) * 2
    plan.sway[:, 1] -= 0.07 * crouch
    plan.pelvis[:, 0] += 0.35 * crouch
    plan.spine[:, 0] += 0.3 * crouch - 0.1 * air
    plan.head[:, 0] -= 0.35 * crouch
    plan.arms[:, :, 0] += (-0.65 * crouch + 1.8 * mood.amplitude * air)[:, None]
    plan.arms[:, :, 1] += (0.1 * crouch + 0.15 * air)[:, None]
    plan.arms[:, :, 3] += (0.2 * crouch + 0.35 * air)[:, None]
    return plan


def hop(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Hop on one foot `count` times, up or forward; the other leg is held bent."""
    side = act.sides[0]
    other = 1 - side
    lift = 0.11 * np.clip(mood.amplitude, 0.75, 1.15) * float(rng.uniform(0.92, 1.08))
    ready = mood.seconds(0.55)
    bounces = Bounces(act.times, lift, 0.09, 0.07, mood.seconds(0.2), begin=ready)
    end = bounces.end + mood.seconds(0.5)
    plan = standing(mood.stance, end + 0.15)
    t = np.arange(plan.frames) / RATE
    plan.height += bounces.height(t)
    if act.direction == "forward":
        _leap_path(plan, bounces, np.array([0.0, 0.28]), mood, (side,))
    _fly(plan, bounces, (side,), 0.0)
    held = ease((t - 0.35 * ready) / 0.35) * ease((end - t) / 0.4)
    plan.legs[:, other] = np.stack([held, 0.5 * held, 0.08 * held, 1.7 * held + 0.1], axis=-1)
    plan.contact[held > 0, other] = False
    last = plan.path[-1]
    plan.ball[t > 0.5 * end, other] = [*np.insert(beside(last, 0.0, other, mood), 1, 0.0)]
    shift_weight(plan, side, 0.05, end + 0.1, 0.9, 0.4)
    effort = bounces.effort(t)
    crouch, air = np.maximum(effort, 0), np.maximum(-effort, 0) * 2
    plan.spine[:, 0] += 0.12 * held + 0.1 * crouch
    plan.arms[:, :, 0] += (0.25 * held - 0.35 * crouch + 0.45 * air)[:, None]
    plan.arms[:, :, 1] += (0.3 * held + 0.15 * air)[:, None]
    plan.arms[:, :, 3] += (0.5 * held)[:, None]
    return plan


def jack(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Jumping jacks: feet apart and arms up, then back, `count` times."""
    lift = 0.085 * np.clip(mood.amplitude, 0.75, 1.15)
    bounces = Bounces(2 * act.times, lift, 0.07, 0.06, mood.seconds(0.16), begin=mood.seconds(0.15))
    plan = standing(mood.stance, bounces.end + 0.25)
    t = np.arange(plan.frames) / RATE
    plan.height += bounces.height(t)
    spread = 0.24 * np.clip(mood.amplitude, 0.8, 1.1)
    keys, values = [0.0], [0.0]
    for k, (takeoff, landing) in enumerate(bounces.flights()):
        s = ease((t - takeoff) / (landing - takeoff))
        for side in (0, 1):
            plan.ball[:, side, 0] += (1 if side == LEFT else -1) * (spread if k % 2 == 0 else -spread) * s
        keys += [takeoff - 0.6 * bounces.push, landing + 0.3 * bounces.soak]
        values += [k % 2, (k + 1) % 2]
    _fly(plan, bounces, (0, 1), 0.02)
    up = curve(t, keys, values)[:, None]
    high = 2.75 * min(mood.amplitude, 1.05)
    plan.arms[:, :, 0] += up * (0.1 - plan.arms[:, :, 0])
    plan.arms[:, :, 1] += up * (high - plan.arms[:, :, 1])
    plan.arms[:, :, 2] += up * (0.5 - plan.arms[:, :, 2])
    plan.arms[:, :, 3] += up * (0.25 - plan.arms[:, :, 3])
    return plan
