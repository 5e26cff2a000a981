"""Feet that are made to stand: what slides stands, what is in the air stays, wherever the body is and faces."""

from __future__ import annotations

import json
import warnings

import numpy as np
import pytest
from strides import jumper, slid, walker

from motionary.errors import InputWarning
from motionary.metrics.physics import foot_skating, jitter, physics
from motionary.motion import Motion, Skeleton, canonicalize, fit_rotations, mirror, retarget
from motionary.motion.kinematics import agrees
from motionary.motion.stances import heights, stance_weights

BELTS = [(0.0, -0.4), (0.2, 0.3)]


def feet_of(motion: Motion) -> np.ndarray:
    return motion.positions[:, list(motion.skeleton.feet)].astype(np.float64)


def stances(motion: Motion) -> np.ndarray:
    """(T - 1, 4) where a foot of a walker stands for certain."""
    height = feet_of(motion)[..., 1]
    low = height - height.min(0) < 1e-4
    return low[1:] & low[:-1]


def pose(motion: Motion) -> np.ndarray:
    return motion.positions - motion.positions[:, :1]


@pytest.mark.parametrize("belt", BELTS)
@pytest.mark.parametrize("fps", [20, 60])
def test_a_walker_on_a_belt_stands_to_the_millimetre(belt, fps):
    true = walker(fps=fps)
    moved = slid(true, belt)
    planted = moved.plant_feet()
    steps = np.linalg.norm(np.diff(feet_of(planted), axis=0), axis=-1)[stances(true)]
    assert np.linalg.norm(np.diff(feet_of(moved), axis=0), axis=-1)[stances(true)].min() > 0.3 / fps
    assert steps.max() < 1e-3
    # It gets to where it would have got without the belt, but for a few centimetres that the legs took.
    assert np.abs(planted.positions[-1, 0] - true.positions[-1, 0]).max() < 0.15 < 0.4 * 6 * max(map(abs, belt))
    high = (heights(feet_of(true))[:, :2] > 0.1).any(1) & (heights(feet_of(true))[:, 2:] < 0.01).all(1)
    upper = [true.skeleton.joints.index(name) for name in ("head", "left_wrist", "right_shoulder")]
    np.testing.assert_allclose(pose(planted)[:, upper], pose(true)[:, upper], atol=1e-5)
    swinging = list(true.skeleton.feet[:2])
    np.testing.assert_allclose(pose(planted)[high][:, swinging], pose(true)[high][:, swinging], atol=1e-3)
    assert jitter(planted) < 1.1 * jitter(moved)


@pytest.mark.parametrize("belt", [(0.0, 1.2), (0.0, -1.2), (0.8, 0.8)])
def test_a_body_that_glides_as_fast_as_it_walks_stands_too(belt):
    moved = slid(walker(), belt)
    assert foot_skating(moved) > 1
    assert foot_skating(moved.plant_feet()) < 0.1


@pytest.mark.parametrize("fps", [20, 60])
def test_a_jump_is_left_alone(fps):
    true = jumper(fps=fps)
    np.testing.assert_allclose(true.plant_feet().positions, true.positions, atol=1e-5)
    planted = slid(true, BELTS[0]).plant_feet()
    air = (heights(feet_of(true)) > 0.05).all(1)
    assert air.sum() > 0.3 * fps
    np.testing.assert_allclose(pose(planted)[air], pose(true)[air], atol=1e-3)
    assert foot_skating(planted) < 1e-3


def test_planted_feet_are_not_planted_again():
    planted = slid(walker(), BELTS[1]).plant_feet()
    apart = np.linalg.norm(planted.plant_feet().positions - planted.positions, axis=-1)
    assert apart.max() < 0.005
    assert apart.mean() < 1e-4


def test_where_the_body_is_and_faces_changes_nothing(moved):
    motion = slid(walker(seconds=3), BELTS[1])
    bare = Motion(motion.positions, motion.fps, motion.skeleton)
    planted = bare.plant_feet()
    turned = moved(bare, 2.0, (30, 1, -5)).plant_feet()
    np.testing.assert_allclose(turned.positions, moved(planted, 2.0, (30, 1, -5)).positions, atol=1e-4)
    np.testing.assert_allclose(mirror(bare).plant_feet().positions, mirror(planted).positions, atol=1e-4)


def test_bones_have_one_length_and_rotations_place_the_joints():
    motion = slid(walker(seconds=3), BELTS[0])
    planted = motion.plant_feet()
    assert agrees(planted, 1e-5)
    assert planted.skeleton == motion.skeleton
    rng = np.random.default_rng(0)
    shaky = Motion(motion.positions + rng.normal(size=motion.positions.shape) * 0.003, motion.fps, motion.skeleton)
    fixed = shaky.plant_feet()
    assert fixed.rotations is None
    assert fixed.skeleton is shaky.skeleton
    assert physics(shaky)["bone_change"] > 0.002 > 1e-6 > physics(fixed)["bone_change"]
    assert foot_skating(fixed) < 0.2 * foot_skating(shaky)


def test_a_body_of_another_size_is_planted_alike():
    motion = slid(walker(seconds=3), BELTS[0])
    tiny = Motion(motion.positions * 0.1, motion.fps, motion.skeleton.with_offsets(motion.skeleton.offsets * 0.1))
    np.testing.assert_allclose(
        tiny.plant_feet().positions * 10, fit_rotations(motion).plant_feet().positions, atol=2e-3
    )


def test_a_rig_without_toes_stands_on_its_ankles(smpl):
    kept = [j for j, name in enumerate(smpl.joints) if not name.endswith("foot")]
    parents = [-1 if smpl.parents[j] < 0 else kept.index(smpl.parents[j]) for j in kept]
    rig = Skeleton.from_rig("no toes", [smpl.joints[j] for j in kept], parents, smpl.offsets[kept])
    true = walker(seconds=4, skeleton=rig)
    planted = slid(true, BELTS[0]).plant_feet()
    ankles = [rig.joints.index("left_ankle"), rig.joints.index("right_ankle")]
    low = true.positions[:, ankles, 1] - true.positions[:, ankles, 1].min(0) < 1e-4
    steps = np.linalg.norm(np.diff(planted.positions[:, ankles], axis=0), axis=-1)
    assert steps[low[1:] & low[:-1]].max() < 1e-3


def test_a_rig_without_legs_is_returned_with_one_line():
    rig = Skeleton.from_rig("snake", ["a", "b", "c"], [-1, 0, 1], np.array([[0, 0, 0], [0, 1, 0], [0, 1, 0]]))
    motion = Motion(np.random.default_rng(0).normal(size=(5, 3, 3)), 20, rig)
    with pytest.warns(InputWarning, match="snake: unknown legs") as seen:
        assert motion.plant_feet() is motion
    assert len(seen) == 1


@pytest.mark.parametrize("frames", [1, 2, 3, 5])
def test_short_motion_is_finite(frames):
    motion = slid(walker(), BELTS[0]).crop(0, frames)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.isfinite(motion.plant_feet().positions).all()


def test_what_stands_is_low_and_slow():
    foot = np.zeros((60, 1, 3))
    foot[20:40, 0, 1] = 0.15 * np.sin(np.linspace(0, np.pi, 20))
    foot[20:40, 0, 2] = np.linspace(0, 0.8, 20)
    foot[40:, 0, 2] = 0.8
    sure = stance_weights(foot, 20, 1.0)[:, 0]
    assert (sure[:19] == 1).all()
    assert (sure[41:] == 1).all()
    assert sure[23:37].max() == 0


@pytest.mark.real
def test_real_clips_that_were_made_to_slide(shared_data, smpl):
    """A root that wanders, as generators make it: feet slide no more than real ones, and nothing jerks."""
    rows = [json.loads(line) for line in (shared_data / "styled" / "clips.jsonl").open()]
    walks = [row for row in rows if row["action"] == "walk"][::40][:4]
    rng = np.random.default_rng(0)
    for row in walks:
        joints = np.load(shared_data / "styled" / row["motion"]).astype(np.float32)[:120]
        real = canonicalize(retarget(Motion(joints, row["fps"], smpl), smpl))
        time = np.arange(real.frames)[:, None] / real.fps
        drift = 0.1 * np.sin(2 * time + rng.uniform(0, 6, 2)) + 0.15 * time * rng.choice([-1, 1], 2)
        shifted = real.positions + np.insert(drift, 1, 0, axis=1)[:, None]
        bad = Motion(shifted, real.fps, smpl)
        planted = bad.plant_feet()
        assert foot_skating(bad) > 0.1
        assert foot_skating(planted) < max(0.058, foot_skating(real))
        assert jitter(planted) < 1.05 * jitter(bad)
