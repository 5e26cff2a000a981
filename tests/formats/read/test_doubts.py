"""What nobody's motion shows is told, whatever the format: rates, speeds, and a root in another unit than the bones."""

from __future__ import annotations

import numpy as np
import pytest
from gltf_made import Made

from motionary.corpus.demo import demo_clip
from motionary.formats import read_motion
from motionary.formats.read import read_motion_with
from motionary.formats.read.doubts import doubts_of
from motionary.motion import Motion, Skeleton

SMPL = Skeleton.named("smpl22")
BONE, HIGH, FPS = 0.45, 0.8, 20.0  # metres of thigh and shin, hip over ankle; frames a second
SOLE = 0.06  # of the ankle over the ground


def person(hips: np.ndarray, ankles: np.ndarray) -> np.ndarray:
    """(T, 22, 3): pelvis at `hips` (T, 3), ankles (T, 2, 3), knees bent as bones of `BONE` ask, the trunk upright."""
    points = hips[:, None] + SMPL.rest - SMPL.rest[0]
    for side, x in enumerate((0.1, -0.1)):
        beside = np.array([x, 0, 0])
        hip, ankle = hips + beside, ankles[:, side] + beside
        way = ankle - hip
        off = np.cross(way, [1.0, 0, 0])
        off *= (np.sqrt(BONE**2 - (way**2).sum(-1) / 4) / np.linalg.norm(off, axis=-1))[:, None]
        points[:, [1 + side, 4 + side, 7 + side, 10 + side]] = np.stack(
            [hip, hip + way / 2 - off, ankle, ankle + np.array([0, -SOLE, 0.15])], axis=1
        )
    return points


def walk(seconds: float = 8.0) -> np.ndarray:
    """At 1 m/s: each foot stands half a second while the other one goes 1 m ahead."""
    time = np.arange(round(seconds * FPS)) / FPS
    hips = np.stack([0 * time, 0 * time + HIGH + SOLE, time], -1)
    ankles = np.zeros((len(time), 2, 3))
    for side in (0, 1):
        steps, share = np.divmod(time + 0.5 * side, 1.0)
        swing = np.clip(2 * share - 1, 0, 1)
        ankles[:, side, 2] = steps + swing + 0.25 - 0.5 * side
        ankles[:, side, 1] = SOLE + 0.1 * np.sin(np.pi * swing)
    return person(hips, ankles)


def squats() -> np.ndarray:
    """On the spot, the hips 0.15 m up and down."""
    time = np.arange(160) / FPS
    hips = np.stack([0 * time, SOLE + 0.7 + 0.15 * np.sin(3 * time), 0 * time], -1)
    return person(hips, np.tile([0.0, SOLE, 0], (160, 2, 1)))


def root_times(points: np.ndarray, times: float) -> np.ndarray:
    """The root's places in another unit."""
    return points + (times - 1) * points[:, :1]


def told(points: np.ndarray, fps: float = FPS) -> list[str]:
    return doubts_of(Motion(points.astype(np.float32), fps, SMPL), False)


@pytest.mark.parametrize("moves", [walk, squats])
@pytest.mark.parametrize("times", [0.01, 0.3048, 0.394, 2.54, 3.28, 10, 100])
def test_a_root_in_another_unit_than_the_bones_is_told(moves, times):
    notes = [note for note in told(root_times(moves(), times)) if "the root's places" in note]
    assert len(notes) == 1
    assert f"are {times:.3g} times" in notes[0]


@pytest.mark.parametrize("moves", [walk, squats])
@pytest.mark.parametrize("place", ["ground", "platform", "roof", "hole", "origin", "treadmill", "pelvis"])
def test_a_body_that_is_only_elsewhere_is_not_told(moves, place):
    points = moves()
    pelvis = points[:, :1]
    move = {
        "ground": 0 * pelvis,
        "platform": np.array([0, 1.0, 0]),
        "roof": np.array([3, 90.0, 5]),
        "hole": np.array([0, -2.0, 0]),
        "origin": -pelvis[:1],
        "treadmill": pelvis * [-1, 0, -1] + [0, 2, 0],
        "pelvis": -pelvis,
    }[place]
    assert told(points + move) == []


@pytest.mark.parametrize("extension", ["bvh", "npy", "glb"])
def test_files_tell_it_and_are_read_as_before(tmp_path, extension):
    mixed = Motion(root_times(walk(), 10).astype(np.float32), FPS, SMPL)
    mixed.save(tmp_path / f"a.{extension}")
    motion, reading = read_motion_with(tmp_path / f"a.{extension}", up="y")
    assert any("are 10 times" in note and "say otherwise" in note for note in reading.notes), reading.notes
    np.testing.assert_allclose(motion.positions[:, 0], mixed.positions[:, 0], atol=1e-3)


@pytest.mark.parametrize(("speed", "notes"), [(4.0, 0), (11.0, 0), (13.0, 1), (120.0, 1)])
def test_a_pelvis_that_nobody_could_follow_is_told(speed, notes):
    """Along the ground: who falls for a second is not told."""
    ahead = (np.arange(60) * speed / FPS)[:, None, None]
    found = told(squats()[:60] + ahead * [0.6, 0, 0.8])
    assert [f"moves at {speed:.3g} m/s" in note and "fps=" in note for note in found] == [True] * notes
    assert told(squats()[:60] + ahead * [0, 1, 0] + [0, 50, 0]) == []


@pytest.mark.parametrize(("fps", "notes"), [(0.5, 1), (2, 1), (5, 0), (12.5, 0), (120, 0), (1000, 0), (1200, 1)])
def test_a_rate_that_nobody_records_at_is_told_unless_it_was_given(tmp_path, fps, notes):
    still = Motion(np.repeat(squats()[:1], 30, axis=0).astype(np.float32), fps, SMPL)
    still.save(tmp_path / "a.npz")
    motion, reading = read_motion_with(tmp_path / "a.npz")
    assert motion.fps == fps
    assert [f"a rate of {fps:g} per second" in note for note in reading.notes] == [True] * notes
    assert read_motion_with(tmp_path / "a.npz", fps=fps)[1].notes == ()
    still.crop(0, 1).save(tmp_path / "b.npz")  # one pose has no rate
    assert read_motion_with(tmp_path / "b.npz")[1].notes == ()


def test_one_clip_at_a_thousand_times_its_rate_is_told_twice(tmp_path):
    """As a frame time of 0.0001 would have it."""
    clip = demo_clip(3)[0]
    assert told(clip.positions, clip.fps) == []
    assert [note.split()[0] for note in told(walk(), 10_000)] == ["a", "the"]
    clip.save(tmp_path / "a.bvh")
    assert read_motion(tmp_path / "a.bvh").frames == clip.frames


@pytest.mark.parametrize(("apart", "keys", "notes"), [(1 / 30, 30, 0), (2.0, 4, 0), (33.3, 10, 1), (100.0, 14, 1)])
def test_gltf_keys_that_lie_apart_as_milliseconds_would_are_told(tmp_path, apart, keys, notes):
    made = Made([{"children": [1]}, {"translation": [0, 1, 0]}])
    turns = np.tile([0.0, 0, 0, 1], (keys, 1))
    made.channel(0, "rotation", apart * np.arange(keys), turns)
    made.channel(1, "rotation", [0, 1000.0], turns[:2])  # a joint that is held through a take has two
    _, reading = read_motion_with(made.glb(tmp_path / "a.glb"))
    found = [note for note in reading.notes if "milliseconds" in note]
    assert [f"keys lie {apart:.3g} s apart" in note and "1000" in note for note in found] == [True] * notes
