"""Frames without a body, which programs write as zeros, are left out at the ends, filled between, and told."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.corpus.demo import demo_clip
from motionary.errors import InputError
from motionary.formats.read import read_motion_with
from motionary.formats.read.gaps import filled, unseen
from motionary.motion import Motion, Skeleton, fit_rotations

CLIP = demo_clip(3)[0]
BODY = CLIP.positions
TALL = len(BODY)
WRIST = CLIP.skeleton.joints.index("left_wrist")


@pytest.fixture
def read(tmp_path):
    def of(positions, **more):
        if more:
            np.savez(tmp_path / "a.npz", positions=positions, fps=CLIP.fps, **more)
            return read_motion_with(tmp_path / "a.npz")
        np.save(tmp_path / "a.npy", positions)
        return read_motion_with(tmp_path / "a.npy", fps=CLIP.fps)

    return of


@pytest.mark.parametrize("place", [0.0, 0.7])
@pytest.mark.parametrize(("front", "back"), [(0, 20), (5, 0), (5, 300)])
def test_padding_at_the_ends_is_left_out_and_told(read, front, back, place):
    padded = np.concatenate([np.full((front, 22, 3), place), BODY, np.full((back, 22, 3), place)]).astype(np.float32)
    motion, reading = read(padded)
    np.testing.assert_array_equal(motion.positions, BODY)
    ends = " and ".join(f"the {name} {n}" for name, n in (("first", front), ("last", back)) if n)
    assert reading.notes == (f"{ends} frames hold no body and were left out",)


def test_padded_rotations_go_with_their_frames(read):
    turned = fit_rotations(CLIP).rotations
    positions, rotations = (np.concatenate([a, np.zeros_like(a[:9])]) for a in (BODY, turned))
    rotations[TALL:, :, 3] = 1
    motion, reading = read(positions, rotations=rotations)
    np.testing.assert_allclose(motion.rotations, turned, atol=1e-6)
    assert reading.notes == ("the last 9 frames hold no body and were left out",)
    rotations[20:23], positions[20:23] = [0, 0, 0, 1], 0
    assert read(positions, rotations=rotations)[0].rotations is None


def test_padded_features_are_left_out(tmp_path):
    from motionary.features import HumanML3D

    features = HumanML3D(CLIP.skeleton).encode(CLIP)
    np.save(tmp_path / "a.npy", np.concatenate([features, np.zeros_like(features[:15])]))
    motion, reading = read_motion_with(tmp_path / "a.npy", fps=CLIP.fps)
    assert motion.frames == len(features)
    assert "the last 15 frames hold no body and were left out" in reading.notes


def test_frames_without_a_body_between_are_filled_on_straight_lines(read):
    gone = BODY.copy()
    gone[30:32] = 0
    motion, reading = read(gone)
    expected = BODY.copy()
    expected[30:32] = BODY[29] + np.array([1, 2])[:, None, None] / 3 * (BODY[32] - BODY[29])
    np.testing.assert_allclose(motion.positions, expected, atol=1e-6)
    assert reading.notes == (f"2 of {TALL} frames hold no body, and were filled on straight lines",)


def test_a_joint_at_zero_in_some_frames_was_not_seen(read):
    gone = BODY.copy()
    gone[30:34, WRIST] = 0
    motion, reading = read(gone)
    line = BODY[29, WRIST] + np.arange(1, 5)[:, None] / 5 * (BODY[34, WRIST] - BODY[29, WRIST])
    np.testing.assert_allclose(motion.positions[30:34, WRIST], line, atol=1e-6)
    assert reading.notes == (f"without a place, filled on straight lines: left_wrist in 4 of {TALL} frames",)


@pytest.mark.parametrize("when", ["always", "at first"])
def test_a_pelvis_at_zero_is_a_body_that_was_moved_there(read, when):
    moved = BODY - (BODY[:, :1] if when == "always" else BODY[:1, :1])
    motion, reading = read(moved)
    np.testing.assert_array_equal(motion.positions, moved)
    assert not [note for note in reading.notes if "frames" in note]


def test_a_pelvis_at_zero_all_the_time_is_one_wherever_the_hips_are(read):
    """Also in the frames in which the hips' middle is farther from it than they are from each other."""
    moved = BODY - BODY[:, :1]
    moved[::7, 1:, 1] -= 0.2
    motion, reading = read(moved)
    np.testing.assert_array_equal(motion.positions, moved)
    assert not any("place" in note or "lack" in note for note in reading.notes)


def test_what_never_has_a_body_and_joints_at_zero_for_good_stay(tmp_path, read):
    assert read(np.zeros((40, 22, 3)))[0].frames == 40
    always = BODY.copy()
    always[:, WRIST] = 0
    assert (read(always)[0].positions[:, WRIST] == 0).all()
    point = Skeleton.from_rig("point", ["a"], [-1], np.zeros((1, 3)))
    np.save(tmp_path / "b.npy", BODY[:, :1])
    assert read_motion_with(tmp_path / "b.npy", skeleton=point)[0].frames == TALL
    own = Motion(
        np.concatenate([BODY[:, :1], BODY[:, :1]], axis=1),
        20,
        Skeleton.from_rig("two", "ab", [-1, 0], np.zeros((2, 3))),
    )
    own.save(tmp_path / "c.npz")
    np.testing.assert_array_equal(read_motion_with(tmp_path / "c.npz")[0].positions, own.positions)


def test_a_helper_of_a_rig_may_lie_at_zero(tmp_path):
    """As a node on the ground, where a motion begins."""
    smpl = CLIP.skeleton
    rig = Skeleton.from_rig("rig", ["ground", *smpl.joints], [-1, *(p + 1 for p in smpl.parents)], np.eye(23, 3))
    positions = np.concatenate([BODY[:, :1] * [1, 0, 1], BODY], axis=1)
    positions -= positions[:1, :1]
    Motion(positions, 20, rig).save(tmp_path / "a.npz")
    motion, reading = read_motion_with(tmp_path / "a.npz")
    np.testing.assert_array_equal(motion.positions, positions)
    assert reading.notes == ()


def test_a_body_missing_most_of_the_time_is_refused(read):
    gone = BODY.copy()
    gone[1:-1] = 0
    with pytest.raises(InputError, match=r"a\.npy, positions, pelvis: missing in 9\d%.*50%") as caught:
        read(gone)
    assert "\n" not in str(caught.value)


def test_ends_that_lack_a_joint_are_told_apart_from_those_without_a_body():
    places = BODY[:10].astype(np.float64)
    places[:2, 5] = places[-1] = 0
    kept, found, notes = filled("a", places, unseen(places, CLIP.skeleton.roles), CLIP.skeleton.joints)
    assert kept == slice(2, 9)
    np.testing.assert_array_equal(found, places[2:9])
    assert notes == ["the first 2 and the last 1 frames lack joints and were left out"]
