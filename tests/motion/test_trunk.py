"""One take on several rigs comes to one body; feet go on standing."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.corpus.demo import demo_clips
from motionary.formats import read_motion
from motionary.metrics import foot_skating
from motionary.motion import Motion, Skeleton, forward_kinematics, heading, resample, retarget
from motionary.motion.facing import rotate_y

# The same takes, by two programs on two bodies. The DAZ files play at double speed.
TWO_SOLVES = [(f"02_0{i}", f"cc_02_0{i}", None) for i in range(1, 5)]
TWO_SOLVES += [("61_10", "daz_salsa_10", 60), ("60_10", "daz_salsa_25", 60)]
# The same takes on the same rig, once as BVH and once as an array without rest pose or rotations.
ONE_RIG = [("35_03", "cmu_35_03"), ("49_04", "cmu_49_04"), ("03_01", "cc_03_01"), ("06_04", "cc_06_04")]


def local(motion: Motion) -> np.ndarray:
    positions = motion.positions.astype(np.float64)
    return rotate_y(positions - positions[:, :1], -heading(motion)[:, None])


def difference(a: Motion, b: Motion) -> float:
    """Mean distance of joints in metres, root and heading removed."""
    frames = min(a.frames, b.frames)
    return float(np.linalg.norm(local(a)[:frames] - local(b)[:frames], axis=-1).mean())


def another_body(smpl: Skeleton) -> Skeleton:
    """smpl22 as another rig would cut it: hips ahead of the root, collars on the spine, a spine that leans."""
    offsets = smpl.offsets.copy()
    for side in ("left", "right"):
        offsets[smpl.roles[f"{side}_hip"]] += [0, -0.02, 0.05]
        moved = offsets[smpl.roles[f"{side}_collar"]] * 0.9
        offsets[smpl.roles[f"{side}_collar"]] -= moved
        offsets[smpl.roles[f"{side}_shoulder"]] += moved
    offsets[smpl.roles["spine1"]] += [0, 0, 0.04]
    offsets[smpl.roles["spine2"]] += [0, 0, -0.04]
    return smpl.with_offsets(offsets)


def test_constant_offsets_between_rigs_cancel(smpl, wriggling):
    motion = wriggling(smpl, size=0.25, frames=200)
    other = another_body(smpl)
    twin = Motion(forward_kinematics(other, motion.rotations, motion.positions[:, 0]), motion.fps, other)
    twin = Motion(twin.positions, motion.fps, other)
    assert difference(twin, motion) > 0.04
    assert difference(retarget(twin, smpl), motion) < 0.02


def test_the_source_on_its_own_proportions_is_not_reshaped(smpl):
    """It is what the source's bone directions and the target's lengths give, with rotations known or not."""
    for motion, _ in demo_clips(6):
        bare = Motion(motion.positions, motion.fps, motion.skeleton)
        points = bare.positions.astype(np.float64)
        expected = np.empty_like(points)
        legs = [4, 7, 5, 8]
        bones = points[:, legs] - points[:, [smpl.parents[j] for j in legs]]
        seen = np.median(np.linalg.norm(bones, axis=-1), axis=0).sum()
        ratio = smpl.bone_lengths[legs].astype(np.float64).sum() / seen
        expected[:, 0] = points[:, 0] * ratio
        for joint, parent in enumerate(smpl.parents[1:], 1):
            bone = points[:, joint] - points[:, parent]
            bone = bone / np.linalg.norm(bone, axis=-1, keepdims=True)
            expected[:, joint] = expected[:, parent] + np.float64(smpl.bone_lengths[joint]) * bone
        expected[..., 1] += points[..., 1].min() - expected[..., 1].min()
        np.testing.assert_allclose(retarget(bare, smpl).positions, expected, rtol=0, atol=2e-7)
        np.testing.assert_array_equal(retarget(bare, smpl).positions, retarget(motion, smpl).positions)


def test_turned_and_scaled_sources_turn_and_scale(smpl, wriggling, moved):
    """The neutral shape is measured in the frame of the trunk: it does not depend on where the body faces."""
    other = another_body(smpl)
    motion = wriggling(other, size=0.25)
    still = retarget(Motion(motion.positions, 20, other), smpl)
    turned = retarget(moved(motion, 1.1, (2, 0, -1)), smpl)
    assert difference(still, turned) < 1e-5
    large = retarget(Motion(motion.positions * 1.7, 20, other), smpl)
    assert difference(still, large) < 1e-5


def test_one_frame_and_a_lying_body_are_carried_over(smpl, wriggling):
    other = another_body(smpl)
    motion = wriggling(other, size=0.25)
    one = retarget(Motion(motion.positions[:1], 20, other), smpl)
    assert np.isfinite(one.positions).all()
    lying = motion.positions[..., [0, 2, 1]] * np.array([1, 1, -1])
    result = retarget(Motion(lying, 20, other), smpl)
    up = result.positions[:, smpl.roles["neck"]] - result.positions[:, 0]
    assert np.abs(up[:, 1]).max() < 0.6 * np.linalg.norm(up, axis=-1).min()


@pytest.mark.real
@pytest.mark.parametrize(("array", "file", "fps"), TWO_SOLVES)
def test_two_solves_of_one_take_come_to_one_body(shared_data, smpl, array, file, fps):
    a = read_motion(shared_data / "captioned" / "motions" / f"{array}.npy")
    b = read_motion(shared_data / "bvh" / "motions" / f"{file}.bvh", fps=fps)
    a, b = (retarget(resample(motion, 20), smpl) for motion in (a, b))
    assert abs(a.frames - b.frames) <= 1
    assert difference(a, b) < 0.025


@pytest.mark.real
@pytest.mark.parametrize(("array", "file"), ONE_RIG)
def test_an_array_and_a_file_of_one_rig_agree(shared_data, smpl, array, file):
    a = read_motion(shared_data / "captioned" / "motions" / f"{array}.npy")
    b = read_motion(shared_data / "bvh" / "motions" / f"{file}.bvh")
    assert difference(*(retarget(resample(motion, 20), smpl) for motion in (a, b))) < 0.002


@pytest.mark.real
def test_feet_that_stand_go_on_standing(shared_data, smpl, planted):
    """Skating of the frames in which the source's feet stand: at most 1.2 times as much, clip by clip."""
    before, after = [], []
    for path in sorted((shared_data / "bvh" / "motions").glob("*.bvh"))[::4]:
        motion = resample(read_motion(path), 20)
        if motion.frames > 20:
            before.append(foot_skating(motion))
            after.append(foot_skating(retarget(motion, smpl), contacts=planted(motion)))
    before, after = np.array(before), np.array(after)
    assert len(before) > 15
    assert (after <= 1.2 * before + 0.005).all()
    assert after.mean() <= 1.1 * before.mean()
