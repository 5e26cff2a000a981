"""Facing, contacts, floor, rate and mirror: closed forms and round trips."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.errors import InputError
from motionary.motion import (
    Motion,
    Skeleton,
    canonicalize,
    foot_contacts,
    forward_kinematics,
    heading,
    mirror,
    resample,
)
from motionary.motion.facing import wrap


def placed(motion):
    return forward_kinematics(motion.skeleton, motion.rotations, motion.positions[:, 0])


def test_heading_is_the_turn_about_up(smpl, t_pose, moved):
    still = Motion(np.tile(t_pose, (3, 1, 1)), 20, smpl)
    np.testing.assert_allclose(heading(still), 0, atol=1e-5)
    for angle in (0.7, -2.5, 3.1):
        np.testing.assert_allclose(heading(moved(still, angle, (3, 1, -2))), angle, atol=1e-5)


def test_heading_without_sides_is_borrowed_or_ahead(smpl, t_pose, moved):
    points = Motion(np.zeros((4, 22, 3)), 20, smpl)
    np.testing.assert_array_equal(heading(points), 0)
    mixed = np.concatenate([points.positions, moved(Motion(t_pose[None], 20, smpl), 1.0).positions, points.positions])
    np.testing.assert_allclose(heading(Motion(mixed, 20, smpl)), 1.0, atol=1e-5)


def test_contacts_tell_standing_feet_at_any_rate(smpl, t_pose):
    for fps in (20.0, 30.0, 120.0):
        positions = np.tile(t_pose, (int(fps), 1, 1))
        positions[:, list(smpl.feet[2:]), 2] += np.arange(int(fps))[:, None] * 2.0 / fps  # 2 m/s: a swinging foot
        positions[:, list(smpl.feet[:2]), 2] += np.arange(int(fps))[:, None] * 0.5 / fps
        contacts = foot_contacts(Motion(positions, fps, smpl))
        assert contacts.shape == (int(fps) - 1, 4)
        np.testing.assert_array_equal(contacts[:, :2], 1)
        np.testing.assert_array_equal(contacts[:, 2:], 0)


def test_canonical_motion_stands_at_the_origin_and_faces_ahead(smpl, wriggling):
    motion = wriggling(smpl)
    result = canonicalize(motion)
    assert abs(result.positions[..., 1].min()) < 1e-6
    np.testing.assert_allclose(result.positions[0, 0, [0, 2]], 0, atol=1e-6)
    np.testing.assert_allclose(heading(result)[0], 0, atol=1e-5)
    np.testing.assert_allclose(placed(result), result.positions, atol=1e-5)
    np.testing.assert_allclose(canonicalize(result).positions, result.positions, atol=1e-5)


def test_canonical_form_does_not_depend_on_place_or_heading(smpl, wriggling, moved):
    motion = wriggling(smpl)
    expected = canonicalize(motion).positions
    for angle, shift in ((1.0, (0, 0, 0)), (-3.0, (5, 2, -7))):
        np.testing.assert_allclose(canonicalize(moved(motion, angle, shift)).positions, expected, atol=2e-5)


@pytest.mark.parametrize("fps", [10.0, 12.5, 30.0, 120.0])
def test_resampled_line_stays_a_line(smpl, t_pose, fps):
    time = np.arange(41) / 20
    positions = t_pose + time[:, None, None] * np.array([1.0, 0.2, -3.0])
    result = resample(Motion(positions, 20, smpl), fps)
    assert result.fps == fps
    assert result.frames == int(2 * fps) + 1
    expected = t_pose + (np.arange(result.frames) / fps)[:, None, None] * np.array([1.0, 0.2, -3.0])
    np.testing.assert_allclose(result.positions, expected, atol=1e-5)


def test_resampling_keeps_frames_and_bones(smpl, wriggling):
    motion = wriggling(smpl)
    finer = resample(motion, 60)
    np.testing.assert_allclose(finer.positions[::3], motion.positions, atol=1e-5)
    np.testing.assert_allclose(placed(finer), finer.positions, atol=1e-5)
    np.testing.assert_allclose(resample(finer, 20).positions, motion.positions, atol=1e-5)
    bare = resample(Motion(motion.positions, 20, smpl), 60)
    assert np.abs(bare.positions - finer.positions).max() < 0.02
    assert resample(motion, 20) is motion


def test_resampling_one_frame_and_wrong_rates(smpl):
    assert resample(Motion(np.zeros((1, 22, 3)), 20, smpl), 60).frames == 1
    for fps in (0, -5, np.nan, np.inf):
        with pytest.raises(InputError, match="fps"):
            resample(Motion(np.zeros((2, 22, 3)), 20, smpl), fps)


def test_a_rounded_frame_time_loses_no_frame(smpl, t_pose):
    motion = Motion(np.tile(t_pose, (601, 1, 1)), 1 / 0.0083333, smpl)
    assert resample(motion, 20).frames == 101


@pytest.mark.parametrize("name", ["smpl22", "kit21"])
def test_mirrored_twice_is_the_motion(name, wriggling):
    motion = wriggling(Skeleton.named(name))
    once = mirror(motion)
    twice = mirror(once)
    np.testing.assert_array_equal(twice.positions, motion.positions)
    np.testing.assert_array_equal(twice.rotations, motion.rotations)
    assert twice.skeleton == motion.skeleton
    np.testing.assert_allclose(placed(once), once.positions, atol=1e-5)


def test_the_mirror_exchanges_sides_and_turns(smpl, wriggling):
    motion = wriggling(smpl)
    result = mirror(motion)
    left, right = smpl.roles["left_wrist"], smpl.roles["right_wrist"]
    np.testing.assert_allclose(result.positions[:, left], motion.positions[:, right] * [-1, 1, 1], atol=1e-6)
    np.testing.assert_allclose(wrap(heading(result) + heading(motion)), 0, atol=1e-5)


def test_pairs_that_tear_bones_are_refused(smpl):
    plain = smpl.to_json()
    plain["pairs"] = [[18, 19]]  # elbows change sides without their shoulders
    with pytest.raises(InputError, match="pairs"):
        mirror(Motion(np.zeros((2, 22, 3)), 20, Skeleton.from_json(plain)))
