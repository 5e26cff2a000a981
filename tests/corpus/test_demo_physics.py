"""The demo clips obey a body: constant bones, planted feet, no floor penetration, gravity, continuity."""

import numpy as np
import pytest

from motionary.corpus.demo import demo_clip, demo_clips
from motionary.corpus.demo.acts import Act
from motionary.corpus.demo.body import rig_of
from motionary.corpus.demo.clip import motion_of, planned
from motionary.corpus.demo.grammar import ACTIONS, Spec, compose
from motionary.corpus.demo.plan import sample
from motionary.corpus.demo.styles import STYLES
from motionary.errors import InputError
from motionary.motion import Motion, Skeleton

SIDES = ("left", "right")
FPS = 20.0


@pytest.fixture(scope="module")
def clips():
    """80 clips with their plans: (name, plan at 20 fps, motion)."""
    result = []
    for index in range(80):
        spec, plan, rig, _ = planned(index, 5)
        name = f"{index}: {'+'.join(a.action for a in spec.acts)} {spec.style}"
        result.append((name, sample(plan, FPS), motion_of(plan, rig, FPS)))
    return result


def joint(motion, name):
    return motion.positions[:, motion.skeleton.roles[name]].astype(np.float64)


def test_bones_keep_the_skeletons_lengths(clips):
    expected = Skeleton.named("smpl22").bone_lengths[1:]
    for name, _, motion in clips:
        parents = list(motion.skeleton.parents[1:])
        lengths = np.linalg.norm(motion.positions[:, 1:] - motion.positions[:, parents], axis=-1)
        assert np.abs(lengths - expected).max() < 1e-4, name


def test_feet_in_contact_stand_still_on_the_floor(clips):
    for name, plan, motion in clips:
        for side, word in enumerate(SIDES):
            ball = joint(motion, f"{word}_foot")
            stands = plan.contact[1:, side] & plan.contact[:-1, side]
            speed = np.linalg.norm(np.diff(ball, axis=0), axis=-1) * FPS
            assert speed[stands].max(initial=0) < 0.01, name
            assert np.abs(ball[plan.contact[:, side], 1]).max(initial=0) < 0.01, name


def test_low_feet_do_not_skate(clips):
    """Read from positions alone: a foot that lies flat (ankle and ball low) hardly moves."""
    skate = []
    for _, _, motion in clips:
        for word in SIDES:
            ball, ankle = joint(motion, f"{word}_foot"), joint(motion, f"{word}_ankle")
            flat = (ball[:, 1] < 0.005) & (ankle[:, 1] < 0.065)
            both = flat[1:] & flat[:-1]
            skate.append(np.linalg.norm(np.diff(ball[:, [0, 2]], axis=0), axis=-1)[both] * FPS)
    assert np.concatenate(skate).mean() < 0.01


def test_nothing_sinks_into_the_floor(clips):
    for name, _, motion in clips:
        assert motion.positions[..., 1].min() > -0.01, name
        assert abs(motion.positions[0, :, 1].min()) < 0.01, name


def test_joints_move_continuously(clips):
    for name, _, motion in clips:
        velocity = np.diff(motion.positions.astype(np.float64), axis=0) * FPS
        acceleration = np.linalg.norm(np.diff(velocity, axis=0) * FPS, axis=-1)
        assert np.linalg.norm(velocity, axis=-1).max() < 15, name  # a fast kick; a jump cut would be more
        assert acceleration.max() < 300, name
        assert acceleration[:, 0].max() < 35, name
        turned = np.abs(np.sum(motion.rotations[1:] * motion.rotations[:-1], axis=-1)).clip(0, 1)
        assert np.degrees(2 * np.arccos(turned)).max() < 95, name


def test_knees_bend_forward(clips):
    """Thigh, shin and the body's left side form a right-handed frame: the shin folds back, never forward."""
    for name, _, motion in clips:
        left = joint(motion, "left_hip") - joint(motion, "right_hip")
        for word in SIDES:
            hip, knee, ankle = (joint(motion, f"{word}_{part}") for part in ("hip", "knee", "ankle"))
            assert (np.sum(np.cross(knee - hip, ankle - knee) * left, axis=-1) > -1e-6).all(), name


def test_rotations_are_the_true_ones(clips):
    """Chaining the local rotations over the rest offsets gives the positions back."""
    import roma
    import torch

    for name, _, motion in clips[::8]:
        local = roma.unitquat_to_rotmat(torch.from_numpy(motion.rotations.astype(np.float64))).numpy()
        world, place = [local[:, 0]], [motion.positions[:, 0].astype(np.float64)]
        for j, parent in enumerate(motion.skeleton.parents[1:], start=1):
            world.append(world[parent] @ local[:, j])
            place.append(place[parent] + world[parent] @ motion.skeleton.offsets[j])
        assert np.abs(np.stack(place, 1) - motion.positions).max() < 1e-4, name


def test_first_frame_is_canonical(clips):
    for name, _, motion in clips:
        across = joint(motion, "left_hip")[0] - joint(motion, "right_hip")[0]
        across = across + joint(motion, "left_shoulder")[0] - joint(motion, "right_shoulder")[0]
        assert abs(np.degrees(np.arctan2(-across[2], across[0]))) < 2, name
        assert np.abs(motion.positions[0, 0, [0, 2]]).max() < 1e-5, name


def test_lengths_are_two_to_ten_seconds(clips):
    seconds = np.array([motion.duration for _, _, motion in clips])
    assert seconds.min() > 2.1
    assert seconds.max() < 9.9
    assert np.median(seconds) < 6


def test_a_flight_falls_as_gravity_says():
    rig = rig_of(Skeleton.named("smpl22"))
    plan = compose(Spec((Act("jump", direction="up", count=1),), "neutral"), np.random.default_rng(1), rig)
    motion = motion_of(plan, rig, 60.0)
    flying = ~sample(plan, 60.0).contact.any(axis=1)
    height = motion.positions[flying, 0, 1].astype(np.float64)
    fall = np.diff(height, 2) * 60.0**2
    assert flying.sum() > 12
    assert np.abs(fall[2:-2].mean() + 9.81) < 0.6  # breathing and posture move the pelvis a little


@pytest.mark.parametrize("style", STYLES)
def test_every_action_can_be_done_in_every_style(style):
    rig = rig_of(Skeleton.named("smpl22"))
    for k, (name, action) in enumerate(ACTIONS.items()):
        first = [values[-1] if values else None for values in (action.sides, action.directions, action.counts)]
        act = Act(name, *first, angle=action.angles[-1] if action.angles else None)
        plan = compose(Spec((act,), style), np.random.default_rng([3, k]), rig)
        motion = motion_of(plan, rig, FPS)
        assert motion.positions[..., 1].min() > -0.01, (name, style)
        for side, word in enumerate(SIDES):
            leg = np.linalg.norm(joint(motion, f"{word}_hip") - joint(motion, f"{word}_ankle"), axis=-1)
            assert leg.max() < (rig.thigh[side] + rig.shin[side]) * 0.99995, (name, style)
        wrists = [joint(motion, f"{word}_wrist") for word in SIDES]
        spine = joint(motion, "spine2")
        for wrist in wrists:
            assert np.linalg.norm(wrist - spine, axis=-1).min() > 0.1, (name, style)


def test_a_clip_depends_on_its_index_and_seed_alone():
    alone, truth = demo_clip(3, seed=9)
    among, truth_among = list(demo_clips(5, seed=9))[3]
    assert np.array_equal(alone.positions, among.positions)
    assert np.array_equal(alone.rotations, among.rotations)
    assert truth == truth_among
    for other in (demo_clip(4, seed=9), demo_clip(3, seed=10)):
        same = other[0].frames == alone.frames and np.allclose(other[0].positions, alone.positions, atol=1e-3)
        assert not same


@pytest.mark.parametrize("fps", [10.0, 12.5, 30.0, 60.0])
def test_another_rate_shows_the_same_movement(fps):
    for index in range(6):
        base, truth = demo_clip(index, seed=2, fps=60.0)
        other, truth_other = demo_clip(index, seed=2, fps=fps)
        assert truth == truth_other
        assert other.fps == fps
        assert abs(other.duration - 1 / fps - base.duration + 1 / 60) <= 1 / fps
        at = np.arange(other.frames) * 60.0 / fps
        low = np.floor(at).astype(int)
        high = np.minimum(low + 1, base.frames - 1)
        part = (at - low)[:, None, None]
        expected = (1 - part) * base.positions[low] + part * base.positions[high]
        assert np.abs(other.positions - expected).max() < 0.012


def test_a_clip_is_a_motion_of_smpl22():
    motion, _ = demo_clip(0)
    assert isinstance(motion, Motion)
    assert motion.skeleton == Skeleton.named("smpl22")
    assert motion.positions.dtype == np.float32
    assert motion.rotations.shape == (motion.frames, 22, 4)


@pytest.mark.parametrize("arguments", [(-1, 0, 20.0), (0, -1, 20.0), (1.5, 0, 20.0), (0, 0, 0.0), (0, 0, float("nan"))])
def test_bad_input_is_named(arguments):
    with pytest.raises(InputError):
        demo_clip(*arguments)
