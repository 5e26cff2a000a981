"""The grammar: which actions there are, what their attributes may be, and how acts become one plan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from motionary.corpus.demo import gestures, jumps, locomotion, whole_body
from motionary.corpus.demo.acts import Act
from motionary.corpus.demo.body import DemoRig, within_reach
from motionary.corpus.demo.curves import RATE, ease, wander
from motionary.corpus.demo.plan import Plan, follow, overlay, standing
from motionary.corpus.demo.styles import STYLES, Mood, mood

LONGEST = 9.6  # seconds
SHORTEST = 2.1
BOTH = ("left", "right", "both")
ONE = ("left", "right")


@dataclass(frozen=True)
class Action:
    """What the grammar knows of an action: its builder and the values its attributes may take.

    Attributes:
        build: (act, mood, rng) -> plan.
        sides, directions, counts, angles: values to draw from; empty where the attribute means nothing.
        weight: how often the action is drawn, relative to the others.
        paced: whether slow and fast are drawn.
        joins: whether it may be followed by, or follow, another action.
        hands: whether it is done by the arms alone, so that legs may walk meanwhile.
    """

    build: Callable[..., Plan]
    sides: tuple[str, ...] = ()
    directions: tuple[str, ...] = ()
    counts: tuple[int, ...] = ()
    angles: tuple[str, ...] = ()
    weight: float = 1.0
    paced: bool = True
    joins: bool = True
    hands: bool = False


ACTIONS: dict[str, Action] = {
    "walk": Action(locomotion.walk, directions=("forward", "forward", "backward", "left", "right"), weight=2.0),
    "run": Action(locomotion.run, directions=("forward", "left", "right"), weight=1.4),
    "circle": Action(locomotion.circle, directions=ONE, joins=False),
    "turn": Action(locomotion.turn, directions=ONE, angles=("quarter", "half", "full"), weight=1.5),
    "sidestep": Action(locomotion.sidestep, directions=ONE, counts=(1, 2, 3), weight=1.3),
    "march": Action(locomotion.march, counts=(4, 6), weight=0.7),
    "knee": Action(locomotion.march, sides=ONE, counts=(1, 2, 3), weight=0.9),
    "jump": Action(
        jumps.jump,
        directions=("up", "up", "forward", "backward", "left", "right"),
        counts=(1, 2, 3),
        weight=1.6,
        paced=False,
    ),
    "hop": Action(jumps.hop, sides=ONE, directions=("up", "forward"), counts=(2, 3, 4), paced=False),
    "jack": Action(jumps.jack, counts=(2, 3, 4), weight=0.7, paced=False),
    "squat": Action(whole_body.squat, counts=(1, 2, 3)),
    "sit": Action(whole_body.sit, weight=0.9),
    "bow": Action(whole_body.bow, counts=(1, 2)),
    "lean": Action(whole_body.lean, directions=ONE, counts=(1, 2)),
    "lunge": Action(whole_body.lunge, sides=ONE, counts=(1, 2)),
    "pick": Action(whole_body.pick_up, sides=ONE),
    "kick": Action(whole_body.kick, sides=ONE, directions=("forward", "side"), counts=(1, 2, 3), weight=1.3),
    "stand": Action(whole_body.stand, weight=0.4, paced=False, joins=False),
    "wave": Action(gestures.wave, sides=BOTH, weight=1.4, hands=True),
    "raise": Action(gestures.lift_arm, sides=BOTH, counts=(1, 2), weight=1.4, hands=True),
    "punch": Action(gestures.punch, sides=BOTH, counts=(2, 3, 4), weight=1.2),
    "clap": Action(gestures.clap, counts=(2, 3, 4), hands=True),
    "point": Action(gestures.point, sides=ONE, directions=("forward", "side"), hands=True),
    "throw": Action(gestures.throw, sides=ONE, counts=(1, 2)),
    "swing": Action(gestures.swing_arm, sides=BOTH, directions=("forward", "backward"), counts=(2, 3)),
}


@dataclass(frozen=True)
class Spec:
    """A whole clip: acts in a style, one after the other or (`together`) the second during the first."""

    acts: tuple[Act, ...]
    style: str
    together: bool = False


def _choose(rng: np.random.Generator, values: tuple):
    return values[int(rng.integers(len(values)))] if values else None


def _draw_act(rng: np.random.Generator, names: list[str], paced: bool, shorter: bool = False) -> Act:
    weights = np.array([ACTIONS[name].weight for name in names])
    name = names[int(rng.choice(len(names), p=weights / weights.sum()))]
    action = ACTIONS[name]
    counts = action.counts[:2] if shorter else action.counts
    speed = (None, None, "slow", "fast")[int(rng.integers(4))] if paced and action.paced else None
    return Act(
        name,
        _choose(rng, action.sides),
        _choose(rng, action.directions),
        _choose(rng, counts),
        speed,
        _choose(rng, action.angles[:2] if shorter else action.angles),
    )


def draw(rng: np.random.Generator) -> Spec:
    """A random clip: mostly one act; a quarter have two; about half are styled, never together with a speed."""
    kind = rng.random()
    styled = rng.random() < 0.45
    names = list(STYLES)[1:]
    style = names[int(rng.integers(len(names)))] if styled else "neutral"
    if kind < 0.74:
        return Spec((_draw_act(rng, list(ACTIONS), not styled),), style)
    if kind < 0.84:
        # Walking forward (or backward) with a gesture of the hands.
        hands = _draw_act(rng, [n for n, a in ACTIONS.items() if a.hands], False)
        walking = Act("walk", direction=("forward", "forward", "backward")[int(rng.integers(3))])
        return Spec((walking, hands), style, together=True)
    joining = [n for n, a in ACTIONS.items() if a.joins]
    first = _draw_act(rng, joining, False, shorter=True)
    second = _draw_act(rng, [n for n in joining if n != first.action], False, shorter=True)
    return Spec((first, second), style)


def _build(act: Act, how: Mood, rng: np.random.Generator, **options) -> Plan:
    return ACTIONS[act.action].build(act, how, rng, **options)


def compose(spec: Spec, rng: np.random.Generator, rig: DemoRig) -> Plan:
    """The plan of a clip: a moment of standing, the acts, a moment of standing; never longer than LONGEST."""
    how = mood(spec.style, spec.acts[0].speed, rng)
    if spec.together:
        gesture = _build(spec.acts[1], how, rng)
        start = 0.35
        body = overlay(_build(spec.acts[0], how, rng, seconds=gesture.seconds + start), gesture, start)
        parts = [body]
    else:
        parts = [_build(act, how, rng) for act in spec.acts]
    before, after = rng.uniform(0.05, 0.3), rng.uniform(0.05, 0.35)
    total = sum(p.seconds for p in parts)
    room = LONGEST - total
    after = max(min(after, room - before), SHORTEST - total - before, 0.02)
    plan = follow(standing(how.stance, before), *parts, standing(how.stance, after))
    _live(plan, rng)
    return within_reach(rig, plan)


def _live(plan: Plan, rng: np.random.Generator) -> None:
    """Breathing and the small, slow unrest of posture (in place); heading at the first frame stays exactly +z."""
    t = np.arange(plan.frames) / RATE
    breath = np.sin(2 * np.pi * (t * rng.uniform(0.25, 0.35) + rng.random()))
    unrest = wander(rng, t, 10)
    turning = ease(t / 0.8)
    plan.spine[:, 0] += 0.012 * breath + 0.014 * unrest[:, 0]
    plan.spine[:, 1] += 0.012 * unrest[:, 1]
    plan.spine[:, 2] += 0.02 * unrest[:, 2] * turning
    plan.head += 0.035 * unrest[:, 3:6] * turning[:, None]
    plan.sway += 0.005 * unrest[:, 6:8]
    plan.height -= 0.003 * (1 - breath)
    plan.arms[:, :, 0] += 0.02 * unrest[:, 8:10]
    plan.arms[:, :, 3] += 0.015 * unrest[:, 9:7:-1]
