"""Forward kinematics and fitted rotations are each other's inverse."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.errors import InputError
from motionary.motion import Motion, Skeleton, fit_rotations, forward_kinematics


def placed(motion):
    return forward_kinematics(motion.skeleton, motion.rotations, motion.positions[:, 0])


def bone_lengths(motion):
    return np.linalg.norm(motion.positions[:, 1:] - motion.positions[:, list(motion.skeleton.parents[1:])], axis=-1)


def test_an_elbow_bent_by_hand(smpl):
    rotations = np.tile([0, 0, 0, 1.0], (1, 22, 1))
    elbow, wrist = smpl.roles["left_elbow"], smpl.roles["left_wrist"]
    rotations[0, elbow] = [0, 0, np.sqrt(0.5), np.sqrt(0.5)]  # a quarter turn about +z lifts +x to +y
    joints = forward_kinematics(smpl, rotations, np.zeros((1, 3)))[0]
    x, y, z = smpl.offsets[wrist]
    np.testing.assert_allclose(joints[wrist] - joints[elbow], [-y, x, z], atol=1e-6)


def test_leading_dimensions_and_wrong_shapes(smpl):
    rotations = np.tile([0, 0, 0, 1.0], (2, 3, 22, 1))
    assert forward_kinematics(smpl, rotations, np.zeros((2, 3, 3))).shape == (2, 3, 22, 3)
    with pytest.raises(InputError, match="rotations"):
        forward_kinematics(smpl, rotations[..., :3], np.zeros((2, 3, 3)))
    with pytest.raises(InputError, match="root_positions"):
        forward_kinematics(smpl, rotations, np.zeros((3, 3)))


@pytest.mark.parametrize("name", ["smpl22", "kit21"])
@pytest.mark.parametrize("size", [0.3, 1.0, 3.0])
def test_fitted_rotations_place_the_joints(name, size, wriggling):
    truth = wriggling(Skeleton.named(name), size=size, seed=3)
    result = fit_rotations(Motion(truth.positions, 20, truth.skeleton))
    assert np.abs(result.positions - truth.positions).max() < 1e-3
    np.testing.assert_allclose(placed(result), result.positions, atol=1e-5)
    np.testing.assert_allclose(result.skeleton.bone_lengths, truth.skeleton.bone_lengths, atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(result.rotations, axis=-1), 1, atol=1e-5)


def test_fitted_rotations_are_true_where_positions_tell_them(smpl, wriggling):
    truth = wriggling(smpl)
    result = fit_rotations(Motion(truth.positions, 20, smpl))
    pelvis = np.abs((result.rotations[:, 0] * truth.rotations[:, 0]).sum(-1))
    np.testing.assert_allclose(pelvis, 1, atol=1e-6)  # a root with three children leaves no freedom


def test_fitted_rest_shape_follows_the_body(smpl, wriggling):
    """A body whose hips are set otherwise than the skeleton's is still placed exactly."""
    offsets = smpl.offsets.copy()
    offsets[1:4] += np.array([[0.03, -0.02, 0.02], [0.0, 0.03, 0.0], [0.0, 0.02, -0.02]])
    truth = wriggling(smpl.with_offsets(offsets))
    result = fit_rotations(Motion(truth.positions, 20, smpl))
    assert np.abs(result.positions - truth.positions).max() < 1e-3


def test_noisy_bones_become_constant(smpl, wriggling):
    truth = wriggling(smpl)
    noisy = truth.positions + np.random.default_rng(0).normal(size=truth.positions.shape) * 0.003
    result = fit_rotations(Motion(noisy, 20, smpl))
    assert bone_lengths(result).std(axis=0).max() < 1e-5
    assert np.linalg.norm(result.positions - truth.positions, axis=-1).mean() < 0.006


def test_rotations_that_fit_are_kept(smpl, wriggling):
    motion = wriggling(smpl)
    assert fit_rotations(motion) is motion
    wrong = Motion(motion.positions, 20, smpl, np.roll(motion.rotations, 7, axis=0))
    assert np.abs(placed(fit_rotations(wrong)) - motion.positions).max() < 1e-3


def test_rotations_move_smoothly_through_opposite_bones(smpl, wriggling):
    """An arm that swings through the direction against its rest bone keeps its twist instead of flipping."""
    still = wriggling(smpl, frames=1, size=0.05)
    positions = np.tile(still.positions, (80, 1, 1))
    shoulder, elbow, wrist = (smpl.roles[f"left_{name}"] for name in ("shoulder", "elbow", "wrist"))
    bone = positions[0, elbow] - positions[0, shoulder]
    angle = np.linspace(np.pi - 0.4, np.pi + 0.4, 80)[:, None]
    side = np.cross(bone, [0.1, 1, 0.05])
    side *= np.linalg.norm(bone) / np.linalg.norm(side)
    positions[:, elbow] = positions[:, shoulder] + np.cos(angle) * bone + np.sin(angle) * side
    positions[:, wrist] = positions[:, elbow] + (positions[0, wrist] - positions[0, elbow])
    result = fit_rotations(Motion(positions, 20, smpl))
    assert np.abs(result.positions - positions).max() < 1e-3
    cosine = np.abs((result.rotations[1:, shoulder] * result.rotations[:-1, shoulder]).sum(-1)).min()
    assert 2 * np.arccos(min(cosine, 1)) < 0.2  # the least rotation from rest alone would flip by 180 degrees


@pytest.mark.parametrize("frames", [1, 2, 30])
def test_degenerate_bodies_stay_finite(smpl, t_pose, frames):
    collapsed = np.zeros((frames, 22, 3))
    line = np.zeros((frames, 22, 3))
    line[..., 1] = np.arange(22) * 0.1
    upside_down = np.tile(t_pose * [1, -1, -1], (frames, 1, 1))
    inside_out = np.tile(-t_pose, (frames, 1, 1))
    flicker = np.tile(t_pose, (frames, 1, 1))
    flicker[::2] = 0
    for positions in (collapsed, line, upside_down, inside_out, flicker):
        result = fit_rotations(Motion(positions, 20, smpl))
        assert np.isfinite(result.rotations).all()
        assert np.isfinite(result.positions).all()
    assert np.abs(fit_rotations(Motion(upside_down, 20, smpl)).positions - upside_down).max() < 1e-3


@pytest.mark.real
def test_the_released_sample_is_placed_within_a_millimetre(shared_data, smpl):
    joints = np.load(shared_data / "humanml3d_sample" / "new_joints" / "012314.npy")
    result = fit_rotations(Motion(joints, 20, smpl))
    assert np.abs(placed(result) - joints).max() < 1e-3


@pytest.mark.real
def test_real_clips_get_constant_bones_near_their_joints(shared_data, smpl):
    for path in sorted((shared_data / "captioned" / "motions").glob("*.npy"))[::40]:
        motion = Motion(np.load(path), 20, smpl)
        result = fit_rotations(motion)
        assert np.isfinite(result.rotations).all()
        assert bone_lengths(result).std(axis=0).max() < 1e-5
        assert np.linalg.norm(result.positions - motion.positions, axis=-1).mean() < 0.02, path.name
        again = fit_rotations(Motion(result.positions, 20, result.skeleton))
        assert np.abs(again.positions - result.positions).max() < 1e-3, path.name
