"""Actions of the whole body on the spot: squat, sit, bow, lean, lunge, pick up, kick, stand."""

from __future__ import annotations

import numpy as np

from motionary.corpus.demo.acts import Act
from motionary.corpus.demo.curves import RATE, curve, ease
from motionary.corpus.demo.gait import Step, beside, shift_weight, take_steps
from motionary.corpus.demo.plan import LEFT, Plan, standing
from motionary.corpus.demo.styles import Mood


def _repeated(mood: Mood, count: int, down: float, hold: float, up: float, rest: float = 0.15):
    """Key times and 0/1 values of a movement done and undone `count` times."""
    times, values = [0.0, 0.15], [0.0, 0.0]
    for k in range(count):
        for seconds, value in ((down, 1.0), (hold, 1.0), (up, 0.0), (rest, 0.0)):
            if k == count - 1 and seconds == rest and value == 0.0:
                break
            times.append(times[-1] + mood.seconds(seconds))
            values.append(value)
    return times, values


def _standing(mood: Mood, end: float) -> tuple[Plan, np.ndarray]:
    plan = standing(mood.stance, end + 0.2)
    return plan, np.arange(plan.frames) / RATE


def _pull_arms(plan: Plan, weight: np.ndarray, pose, sides=(0, 1)) -> None:
    """Blend arms towards a pose (4,) by a weight (N,) (in place)."""
    for side in sides:
        plan.arms[:, side] += weight[:, None] * (np.asarray(pose) - plan.arms[:, side])


def squat(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Squat down with the arms stretched forward and come up again, `count` times."""
    times, values = _repeated(mood, act.times, 0.65, 0.05, 0.62, 0.12)
    plan, t = _standing(mood, times[-1])
    low = curve(t, times, values)
    depth = 0.42 * np.clip(mood.amplitude, 0.7, 1.08) + float(rng.uniform(-0.02, 0.03))
    plan.height -= low * (depth - 0.5 * mood.style.crouch)
    plan.sway[:, 1] -= 0.17 * low
    plan.pelvis[:, 0] += 0.5 * low
    plan.spine[:, 0] += 0.15 * low
    plan.head[:, 0] -= 0.35 * low
    _pull_arms(plan, low, (1.75, 0.05, 0.0, 0.12))
    return plan


def sit(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Sit down on a seat at knee height, stay, and stand up again."""
    down, hold = mood.seconds(1.05), 0.95 + 0.7 * float(rng.random())
    up = mood.seconds(1.0)
    times = np.cumsum([0.15, down, hold, up])
    plan, t = _standing(mood, times[-1])
    low = curve(t, times, [0, 1, 1, 0])
    lean = curve(
        t,
        [0.1, times[0] + 0.55 * down, times[1] + 0.1, times[2] - 0.1, times[2] + 0.4 * up, times[3]],
        [0, 1, 0, 0, 1, 0],
    )
    plan.height -= low * (0.43 - mood.style.crouch)
    plan.sway[:, 1] -= 0.36 * low
    plan.pelvis[:, 0] += 0.6 * lean - 0.05 * low
    plan.spine[:, 0] += 0.3 * lean
    plan.head[:, 0] -= 0.35 * lean
    _pull_arms(plan, low, (0.62, 0.1, -0.15, 0.75))
    return plan


def bow(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Bow forward with straight legs and come up again, `count` times."""
    times, values = _repeated(mood, act.times, 0.8, 0.35, 0.8, 0.15)
    plan, t = _standing(mood, times[-1])
    low = curve(t, times, values) * np.clip(mood.amplitude, 0.75, 1.1) * float(rng.uniform(0.92, 1.08))
    plan.pelvis[:, 0] += 0.75 * low
    plan.spine[:, 0] += 0.55 * low
    plan.head[:, 0] += 0.25 * low
    plan.sway[:, 1] -= 0.11 * low
    plan.height -= 0.015 * low
    _pull_arms(plan, 0.8 * np.clip(low, 0, 1), (0.15, 0.1, 0.0, 0.15))
    return plan


def lean(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Bend the trunk to the left or to the right and come back, `count` times."""
    times, values = _repeated(mood, act.times, 0.75, 0.3, 0.75, 0.12)
    plan, t = _standing(mood, times[-1])
    size = act.turn * curve(t, times, values) * np.clip(mood.amplitude, 0.8, 1.15) * float(rng.uniform(0.95, 1.1))
    plan.spine[:, 1] += 0.72 * size
    plan.pelvis[:, 1] += 0.13 * size
    plan.head[:, 1] += 0.2 * size
    plan.sway[:, 0] -= 0.05 * size
    near = 0 if act.turn > 0 else 1
    # The near arm hangs straight down, the far one follows the trunk.
    plan.arms[:, near, 1] += 0.35 * np.abs(size)
    plan.arms[:, 1 - near, 1] += 0.2 * np.abs(size)
    return plan


def lunge(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Step far forward with one foot, sink, and step back, `count` times."""
    side = act.sides[0]
    reach = 0.66 * np.clip(mood.amplitude, 0.75, 1.08)
    out, hold, home = mood.seconds(0.6), mood.seconds(0.5), mood.seconds(0.6)
    begin, steps, times, values = 0.2, [], [0.0, 0.1], [0.0, 0.0]
    toe = mood.stance.toe_out * (1 if side == LEFT else -1)
    for _ in range(act.times):
        there = beside(np.array([0.0, reach]), 0.0, side, mood)
        back = beside(np.zeros(2), 0.0, side, mood)
        leave = begin + out + hold
        steps += [
            Step(side, begin, begin + out, there, toe, 0.1, 0.3, 0.1),
            Step(side, leave, leave + home, back, toe, 0.1, 0.3, 0.1),
        ]
        times += [begin + 1.15 * out, leave - 0.05, leave + home]
        values += [1.0, 1.0, 0.0]
        begin = leave + home + mood.seconds(0.12)
        times.append(begin)
        values.append(0.0)
    plan, t = _standing(mood, begin)
    take_steps(plan, steps)
    low = curve(t, times, values)
    plan.sway[:, 1] += 0.52 * reach * low
    shift_weight(plan, 1 - side, 0.05, 0.1 + out, 0.45, 0.2)
    plan.height -= low * (0.27 - 0.5 * mood.style.crouch)
    plan.foot_pitch[:, 1 - side] += 0.95 * low
    plan.spine[:, 0] += 0.08 * low
    plan.arms[:, 1 - side, 0] += 0.5 * low
    plan.arms[:, 1 - side, 3] += 0.6 * low
    plan.arms[:, side, 0] -= 0.35 * low
    plan.arms[:, side, 3] += 0.4 * low
    return plan


def pick_up(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Bend down, pick something up from the floor with one hand and lift it before the chest."""
    side = act.sides[0]
    sign = 1 if side == LEFT else -1
    down, grasp, up = mood.seconds(0.95), mood.seconds(0.3), mood.seconds(0.95)
    times = np.cumsum([0.15, down, grasp, up])
    end = times[-1] + mood.seconds(0.45) + mood.seconds(0.6)
    plan, t = _standing(mood, end)
    low = curve(t, times, [0, 1, 1, 0])
    plan.height -= low * (0.36 - 0.5 * mood.style.crouch)
    plan.sway[:, 1] -= 0.14 * low
    plan.pelvis[:, 0] += (0.85 - 0.5 * mood.style.lean) * low
    plan.spine[:, 0] += (0.62 - 0.5 * max(mood.stance.spine[0], 0)) * low
    plan.spine[:, 1] += sign * 0.16 * low
    plan.spine[:, 2] -= sign * 0.22 * low
    plan.head[:, 0] -= 0.2 * low
    rest = np.array(mood.stance.arms)
    grab, show = (1.35, 0.05, 0.0, 0.1), (0.55, 0.12, -0.25, 1.75)
    keys = [0.15, times[1], times[2], times[3] + 0.05, times[3] + mood.seconds(0.45), end]
    plan.arms[:, side] = curve(t, keys, np.stack([rest, grab, grab, show, show, rest]))
    _pull_arms(plan, low, (0.5, 0.15, 0.0, 0.9), (1 - side,))
    return plan


def kick(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Kick with one foot, forward or sideways, `count` times: knee up, strike, back."""
    side = act.sides[0]
    sign = 1 if side == LEFT else -1
    beat = 0.98 / min(mood.tempo, 1.3)
    begin, big = mood.seconds(0.45), np.clip(mood.amplitude, 0.88, 1.15)
    end = begin + beat * act.times + mood.seconds(0.45)
    plan, t = _standing(mood, end)
    high = 1.35 * big + float(rng.uniform(-0.08, 0.1))
    if act.direction == "side":
        poses = [(0.5, 0.5, 1.5), (0.1, 0.92 * high, 0.1), (0.45, 0.5, 1.3)]
    else:
        poses = [(0.95 * big, 0.05, 1.5), (high, 0.05, 0.12), (0.9 * big, 0.05, 1.35)]
    for k in range(act.times):
        start = begin + k * beat
        keys = [start, start + 0.32 * beat, start + 0.5 * beat, start + 0.68 * beat, start + 0.97 * beat]
        angles = curve(t, keys, [(0, 0.02, 0.12), *poses, (0, 0.02, 0.12)])
        during = (t > keys[0]) & (t < keys[-1])
        free = ease((t - keys[0]) / (0.22 * beat)) * ease((keys[-1] - t) / (0.22 * beat))
        plan.legs[during, side] = np.concatenate([free[:, None], angles], axis=-1)[during]
        plan.contact[during, side] = False
    strike = np.maximum(plan.legs[:, side, 1] + plan.legs[:, side, 2] * (act.direction == "side"), 0) / 1.35
    active = ease((t - 0.1) / (begin - 0.1)) * ease((end - t) / mood.seconds(0.4))
    shift_weight(plan, 1 - side, 0.08, end, 0.9, mood.seconds(0.38))
    if act.direction == "side":
        plan.spine[:, 1] -= sign * 0.35 * strike
        plan.pelvis[:, 1] -= sign * 0.22 * strike
    else:
        plan.spine[:, 0] -= 0.18 * strike
        plan.pelvis[:, 0] -= 0.2 * strike
        plan.pelvis[:, 2] -= sign * 0.15 * strike
    plan.height -= 0.025 * active
    _pull_arms(plan, 0.85 * active, (0.55, 0.35, -0.3, 1.5))
    plan.arms[:, side, 0] -= 0.7 * strike
    plan.arms[:, 1 - side, 0] += 0.3 * strike
    return plan


def stand(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Stand still, with the small unrest of a living body."""
    plan, t = _standing(mood, 2.2 + 1.5 * float(rng.random()))
    drift = float(rng.choice([-1, 1])) * 0.03
    plan.sway[:, 0] += drift * ease((t - 0.5) / 1.2) * ease((t[-1] - t) / 0.8)
    return plan
