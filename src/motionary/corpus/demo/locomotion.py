"""Actions that go somewhere on their feet: walk, run, circle, turn, sidestep, march."""

from __future__ import annotations

import numpy as np

from motionary.corpus.demo.acts import Act
from motionary.corpus.demo.curves import RATE, curve, ease
from motionary.corpus.demo.gait import Rhythm, Step, beside, shift_weight, take_steps, travel
from motionary.corpus.demo.plan import LEFT, RIGHT, Plan, standing
from motionary.corpus.demo.styles import Mood

TURNS = {"quarter": np.pi / 2, "half": np.pi, "full": 2 * np.pi}


def _arc_shape(length: float, angle: float, straight: float = 0.0):
    """A path of `length` metres that bends by `angle` after a straight share; heading along the path."""

    def shape(progress: np.ndarray):
        """Ground positions (N, 2) and headings (N,) at shares (N,) of the path."""
        dense = np.linspace(0, 1, 400)
        bend = np.clip((dense - straight) / max(1 - straight, 1e-6), 0, 1)
        yaw = angle * bend
        step = length / (len(dense) - 1)
        # Midpoint rule along the dense path.
        middle = 0.5 * (yaw[1:] + yaw[:-1])
        x = np.concatenate([[0], np.cumsum(np.sin(middle))]) * step
        z = np.concatenate([[0], np.cumsum(np.cos(middle))]) * step
        at = lambda values: np.interp(progress, dense, values)  # noqa: E731
        return np.stack([at(x), at(z)], axis=-1), at(yaw)

    return shape


def _stride(mood: Mood, act: Act, base: float) -> float:
    """Length of one step: styles and speeds change it less than they change the tempo."""
    return base * float(np.clip(mood.amplitude, 0.7, 1.12)) * {None: 1.0, "slow": 0.72, "fast": 1.12}[act.speed]


def _tempo(mood: Mood, low: float, high: float) -> float:
    """A gait's own share of the tempo: cadence varies less than gestures do."""
    return float(np.clip(mood.tempo**0.55, low, high))


def walk(act: Act, mood: Mood, rng: np.random.Generator, seconds: float | None = None) -> Plan:
    """Walk forward (straight, or bending left or right) or backward; at least `seconds` long where given."""
    backward = act.direction == "backward"
    cycle = (1.2 if backward else 1.06) / _tempo(mood, 0.75, 1.18)
    stride = _stride(mood, act, 0.42 if backward else 0.6)
    steps = int(rng.integers(5, 8)) if seconds is None else max(4, int(np.ceil((seconds - 0.5) / cycle * 2)))
    length = stride * (steps - 0.6)
    lead = int(rng.integers(2))
    if backward:
        rhythm = Rhythm(cycle, 0.64, 0.06, 0.2, 1.0, 0.1, 0.012, 0.5, 0.2, 0.05, 0.02)
        shape = lambda p: (np.stack([0 * p, -length * p], axis=-1), 0 * p)  # noqa: E731
    else:
        rhythm = Rhythm(cycle, 0.62, 0.065, 0.5, 1.0, 0.18, 0.018, 0.5, 0.45, 0.1, 0.04)
        angle = act.turn * float(rng.uniform(1.35, 1.75))
        shape = _arc_shape(length, angle, 0.15 if angle else 0.0)
    return travel(mood, shape, steps, rhythm, lead)


def run(act: Act, mood: Mood, rng: np.random.Generator, seconds: float | None = None) -> Plan:
    """Run forward, straight or bending left or right."""
    cycle = 0.66 / _tempo(mood, 0.95, 1.12)
    steps = int(rng.integers(7, 10)) if seconds is None else max(5, int(np.ceil((seconds - 0.5) / cycle * 2)))
    length = float(np.clip(_stride(mood, act, 0.98), 0.9, 1.12)) * (steps - 2)
    rhythm = Rhythm(cycle, 0.33, 0.25, 0.75, 1.35, 0.12, 0.035, 0.85, 0.8, 1.0, 0.13, 3.6)
    angle = act.turn * float(rng.uniform(1.35, 1.75))
    return travel(mood, _arc_shape(length, angle, 0.1), steps, rhythm, int(rng.integers(2)))


def circle(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Walk once round a circle to the left (counterclockwise from above) or to the right."""
    cycle = 1.02 / _tempo(mood, 0.8, 1.25)
    stride = _stride(mood, act, 0.6)
    steps = int(rng.integers(9, 12))
    rhythm = Rhythm(cycle, 0.62, 0.065, 0.45, 1.0, 0.18, 0.018, 0.5, 0.4, 0.1, 0.04)
    shape = _arc_shape(stride * (steps - 0.6), act.turn * 2 * np.pi)
    plan = travel(mood, shape, steps, rhythm, LEFT if act.turn > 0 else RIGHT)
    inward = ease(np.minimum(np.arange(plan.frames), plan.frames - 1 - np.arange(plan.frames)) / RATE / 0.6)
    plan.pelvis[:, 1] += 0.06 * act.turn * inward
    return plan


def turn(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Turn on the spot by steps, by a quarter, a half or a full turn to the left or to the right."""
    angle = TURNS[act.angle or "half"] * act.turn
    steps = {"quarter": 3, "half": 4, "full": 8}[act.angle or "half"]
    cycle = 0.86 / _tempo(mood, 0.75, 1.3)
    rhythm = Rhythm(cycle, 0.62, 0.05, 0.25, 1.0, 0.1, 0.01, 0.5, 0.1, 0.1, 0.0)
    shape = lambda p: (np.zeros((len(p), 2)), angle * p)  # noqa: E731
    plan = travel(mood, shape, steps, rhythm, LEFT if act.turn > 0 else RIGHT)
    # The head looks ahead into the turn.
    rate = np.gradient(plan.yaw) * RATE
    plan.head[:, 2] += np.clip(0.25 * rate, -0.45, 0.45)
    plan.spine[:, 2] += np.clip(0.12 * rate, -0.25, 0.25)
    plan.arms[:, :, 1] += 0.08 * np.minimum(np.abs(rate), 1.5)[:, None]
    return plan


def sidestep(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Step sideways: the near foot reaches out, the other closes up, `count` times."""
    lead = LEFT if act.turn > 0 else RIGHT
    width = _stride(mood, act, 0.42) * float(rng.uniform(0.95, 1.08))
    swing, pause = mood.seconds(0.42), mood.seconds(0.1)
    begin, steps, roots = 0.2, [], [(0.0, 0.0)]
    for k in range(act.times):
        for j, side in enumerate((lead, 1 - lead)):
            start = begin + (2 * k + j) * (swing + pause)
            place = np.array([act.turn * width * (k + 1), 0.0])
            out = mood.stance.toe_out * (1 if side == LEFT else -1)
            steps.append(Step(side, start, start + swing, beside(place, 0.0, side, mood), out, 0.07, 0.22, 0.08))
            # Halfway after the first foot, all the way when the second has closed up.
            roots.append((start + 0.9 * swing, act.turn * width * (k + (0.55, 1.0)[j])))
    end = steps[-1].end
    plan = standing(mood.stance, end + 0.3)
    take_steps(plan, steps)
    t = np.arange(plan.frames) / RATE
    roots[0] = (0.1, 0.0)
    plan.path[:, 0] = curve(t, [r[0] for r in roots], [r[1] for r in roots])
    active = ease(t / 0.4) * ease((end + 0.2 - t) / 0.4)
    plan.height -= 0.03 * active
    speed = np.gradient(plan.path[:, 0]) * RATE
    plan.spine[:, 1] -= 0.06 * np.tanh(speed / 0.5)
    plan.arms[:, :, 1] += (0.16 * mood.amplitude * np.abs(np.tanh(speed / 0.4)))[:, None]
    plan.head[:, 2] += 0.3 * act.turn * active
    return plan


def march(act: Act, mood: Mood, rng: np.random.Generator) -> Plan:
    """Lift the knees on the spot: one knee `count` times, or both in turn (`count` lifts in all)."""
    lift = mood.seconds(0.78)
    begin = 0.25
    first = int(rng.integers(2))
    order = [(first + k) % 2 if len(act.sides) == 2 else act.sides[0] for k in range(act.times)]
    plan = standing(mood.stance, begin + lift * act.times + 0.35)
    t = np.arange(plan.frames) / RATE
    height = 1.5 * np.clip(mood.amplitude, 0.75, 1.1)
    for k, side in enumerate(order):
        start = begin + k * lift
        rise = curve(t, [start, start + 0.45 * lift, start + 0.55 * lift, start + 0.96 * lift], [0, 1, 1, 0])
        free = ease(rise / 0.35)
        leg = np.stack([free, height * rise, 0.06 * rise, 1.55 * rise + 0.1], axis=-1)
        up = rise > 0
        plan.legs[up, side] = leg[up]
        plan.contact[up, side] = False
        shift_weight(plan, 1 - side, start - 0.2, start + lift + 0.12, 0.8, min(0.32, 0.4 * lift))
        other = 1 - side
        plan.arms[:, other, 0] += 0.55 * mood.amplitude * rise
        plan.arms[:, other, 3] += 0.5 * rise
        plan.arms[:, side, 0] -= 0.3 * mood.amplitude * rise
    return plan
