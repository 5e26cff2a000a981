"""What the demo clips' labels say, their motions show; read here by simple geometry of our own."""

import numpy as np
import pytest

from motionary.corpus.demo.acts import Act
from motionary.corpus.demo.body import rig_of
from motionary.corpus.demo.clip import motion_of
from motionary.corpus.demo.grammar import Spec, compose
from motionary.corpus.demo.plan import sample
from motionary.corpus.demo.styles import STYLES
from motionary.motion import Skeleton

FPS = 20.0


def perform(*acts, style="neutral", seed=0, together=False):
    """Motion and sampled plan of one spec."""
    rig = rig_of(Skeleton.named("smpl22"))
    plan = compose(Spec(acts, style, together), np.random.default_rng(seed), rig)
    return motion_of(plan, rig, FPS), sample(plan, FPS)


def joint(motion, name):
    return motion.positions[:, motion.skeleton.roles[name]].astype(np.float64)


def heading(motion):
    """(T,) degrees, unwrapped, growing to the left."""
    across = joint(motion, "left_hip") - joint(motion, "right_hip")
    return np.degrees(np.unwrap(np.arctan2(-across[:, 2], across[:, 0])))


def episodes(high):
    """How often a bool curve becomes true."""
    return int(high[0]) + int((high[1:] & ~high[:-1]).sum())


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("side", ["left", "right", "both"])
@pytest.mark.parametrize("action", ["wave", "raise"])
def test_the_named_hand_rises_above_the_head(action, side, style):
    motion, _ = perform(Act(action, side=side, count=1 if action == "raise" else None), style=style)
    for word in ("left", "right"):
        above = (joint(motion, f"{word}_wrist")[:, 1] - joint(motion, "head")[:, 1]).max()
        if side in (word, "both"):
            assert above > 0.05
        else:
            assert above < -0.2


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_named_hand_acts(side):
    other = "right" if side == "left" else "left"
    for act in (
        Act("punch", side=side, count=2),
        Act("point", side=side, direction="forward"),
        Act("throw", side=side, count=1),
    ):
        motion, _ = perform(act)
        reach = {w: joint(motion, f"{w}_wrist")[:, 2] - joint(motion, "spine3")[:, 2] for w in (side, other)}
        assert reach[side].max() > 0.35, act
        assert reach[side].max() > reach[other].max() + 0.15, act
    motion, _ = perform(Act("pick", side=side))
    assert joint(motion, f"{side}_wrist")[:, 1].min() < 0.3
    assert joint(motion, f"{side}_wrist")[:, 1].min() < joint(motion, f"{other}_wrist")[:, 1].min() - 0.1


@pytest.mark.parametrize("count", [2, 3, 4])
def test_hands_clap_as_often_as_said(count):
    motion, _ = perform(Act("clap", count=count))
    apart = np.linalg.norm(joint(motion, "left_wrist") - joint(motion, "right_wrist"), axis=-1)
    assert episodes(apart < 0.15) == count
    assert apart.min() > 0.02


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("direction", ["up", "forward", "backward", "left", "right"])
def test_jumps_leave_the_floor_as_often_as_said_and_go_there(direction, count):
    motion, _ = perform(Act("jump", direction=direction, count=count), seed=count)
    low = np.minimum(joint(motion, "left_foot")[:, 1], joint(motion, "right_foot")[:, 1])
    assert episodes(low > 0.08) == count
    x, z = motion.positions[-1, 0, [0, 2]]
    along = {"forward": z, "backward": -z, "left": x, "right": -x}.get(direction)
    if along is None:
        assert abs(x) + abs(z) < 0.05
    else:
        assert 0.2 * count < along < 0.7 * count
        assert abs(x if direction in ("forward", "backward") else z) < 0.05


@pytest.mark.parametrize("side", ["left", "right"])
def test_hops_are_on_the_named_foot(side):
    other = "right" if side == "left" else "left"
    motion, plan = perform(Act("hop", side=side, direction="up", count=3))
    assert episodes(joint(motion, f"{side}_foot")[:, 1] > 0.05) == 3
    in_air = ~plan.contact.any(axis=1)
    assert joint(motion, f"{other}_foot")[in_air, 1].min() > 0.15


@pytest.mark.parametrize("action", ["walk", "run"])
@pytest.mark.parametrize("style", STYLES)
def test_walks_go_forward_and_runs_go_faster(action, style):
    motion, plan = perform(Act(action, direction="forward"), style=style)
    x, z = motion.positions[-1, 0, [0, 2]]
    assert z > 1.2
    assert abs(x) < 0.1
    flights = (~plan.contact.any(axis=1)).sum()
    assert flights > 5 if action == "run" else flights == 0


@pytest.mark.parametrize(("direction", "sign"), [("left", 1), ("right", -1)])
def test_curves_circles_and_turns_go_round_the_said_way(direction, sign):
    for action in ("walk", "run"):
        motion, _ = perform(Act(action, direction=direction))
        assert 60 < sign * heading(motion)[-1] < 120
        assert sign * motion.positions[-1, 0, 0] > 0.4
    motion, _ = perform(Act("circle", direction=direction))
    assert abs(sign * heading(motion)[-1] - 360) < 8
    assert np.linalg.norm(motion.positions[-1, 0, [0, 2]]) < 0.15
    assert np.linalg.norm(motion.positions[:, 0, [0, 2]], axis=-1).max() > 1.0
    for angle, degrees in (("quarter", 90), ("half", 180), ("full", 360)):
        motion, _ = perform(Act("turn", direction=direction, angle=angle))
        assert abs(sign * heading(motion)[-1] - degrees) < 6
        assert np.linalg.norm(motion.positions[:, 0, [0, 2]], axis=-1).max() < 0.2


@pytest.mark.parametrize(("direction", "sign"), [("left", 1), ("right", -1)])
@pytest.mark.parametrize("count", [1, 3])
def test_sidesteps_go_sideways(direction, sign, count):
    motion, plan = perform(Act("sidestep", direction=direction, count=count))
    x, z = motion.positions[-1, 0, [0, 2]]
    assert 0.3 * count < sign * x < 0.6 * count
    assert abs(z) < 0.05
    assert np.abs(heading(motion)).max() < 12
    for side in (0, 1):
        assert episodes(~plan.contact[:, side]) == count


def test_walking_backward_goes_back():
    motion, _ = perform(Act("walk", direction="backward"))
    assert motion.positions[-1, 0, 2] < -0.8
    assert np.abs(heading(motion)).max() < 15


def test_slow_takes_longer_than_fast():
    for act in ("bow", "walk", "punch", "squat"):
        length = {}
        for speed in ("slow", None, "fast"):
            spec = Act(act, side="left", direction="forward", count=2, speed=speed)
            length[speed] = perform(spec, seed=4)[0].duration
        assert length["slow"] > 1.12 * length[None] > 1.12 * 1.05 * length["fast"], act


@pytest.mark.parametrize("count", [1, 2, 3])
def test_squats_go_down_as_often_as_said(count):
    motion, _ = perform(Act("squat", count=count))
    assert episodes(motion.positions[:, 0, 1] < 0.75) == count


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("action", ["kick", "knee", "lunge"])
def test_the_named_leg_acts_as_often_as_said(action, side):
    other = "right" if side == "left" else "left"
    motion, plan = perform(Act(action, side=side, direction="forward" if action == "kick" else None, count=2))
    assert plan.contact[:, ("left", "right").index(other)].all()
    if action == "knee":
        reached = joint(motion, f"{side}_knee")[:, 1] > 0.75
    elif action == "kick":
        reached = joint(motion, f"{side}_ankle")[:, 2] - motion.positions[:, 0, 2] > 0.5
    else:
        reached = joint(motion, f"{side}_ankle")[:, 2] - joint(motion, f"{other}_ankle")[:, 2] > 0.45
    assert episodes(reached) == 2


@pytest.mark.parametrize(("direction", "sign"), [("left", 1), ("right", -1)])
def test_leans_go_to_the_said_side(direction, sign):
    motion, _ = perform(Act("lean", direction=direction, count=2))
    tilt = sign * (joint(motion, "neck") - joint(motion, "pelvis"))[:, 0]
    assert episodes(tilt > 0.15) == 2
    assert tilt.min() > -0.08


def test_sitting_lowers_the_hips_and_bowing_the_head():
    motion, _ = perform(Act("sit"))
    low = motion.positions[:, 0, 1] < 0.62
    assert low.sum() > FPS * 0.8
    assert episodes(low) == 1
    motion, _ = perform(Act("bow", count=2))
    forward = (joint(motion, "head") - joint(motion, "pelvis"))[:, 2]
    assert episodes(forward > 0.4) == 2


@pytest.mark.parametrize(("direction", "sign"), [("forward", 1), ("backward", -1)])
def test_arms_swing_full_circles(direction, sign):
    motion, _ = perform(Act("swing", side="left", direction=direction, count=2))
    arm = joint(motion, "left_wrist") - joint(motion, "left_shoulder")
    turned = np.unwrap(np.arctan2(arm[:, 2], -arm[:, 1]))
    assert round(sign * (turned[-1] - turned[0]) / (2 * np.pi)) == 2


def test_two_acts_follow_or_overlap():
    walk, wave = Act("walk", direction="forward"), Act("wave", side="right")
    for together in (False, True):
        motion, _ = perform(walk, wave, together=together)
        above = joint(motion, "right_wrist")[:, 1] > joint(motion, "head")[:, 1]
        speed = np.abs(np.gradient(motion.positions[:, 0, 2])) * FPS
        assert above.sum() > 5
        assert motion.positions[-1, 0, 2] > 1
        assert (speed[above].mean() > 0.4) == together


def test_styles_change_the_posture():
    trunk = {}
    for style in STYLES:
        motion, _ = perform(Act("walk", direction="forward"), style=style)
        up = joint(motion, "neck") - joint(motion, "pelvis")
        trunk[style] = np.degrees(np.arctan2(up[:, 2], up[:, 1])).mean()
    assert trunk["old"] > trunk["tired"] > trunk["neutral"] > trunk["proud"]
    fast, slow = (perform(Act("bow", count=1), style=s)[0].duration for s in ("angry", "old"))
    assert fast < slow
