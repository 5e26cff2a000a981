"""Where motions stand and what the camera sees: by geometry alone."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from motionary.app.staging import places, smoothed, viewpoint, way_of
from motionary.corpus.demo import demo_clip
from motionary.motion import Motion


@pytest.fixture(scope="module")
def walk() -> Motion:
    return demo_clip(3)[0]


def moved(motion: Motion, speed: float) -> Motion:
    """The motion on a belt that runs to the right, metres per second."""
    away = np.arange(motion.frames)[:, None] / motion.fps * [speed, 0, 0]
    return Motion(motion.positions + away[:, None], motion.fps, motion.skeleton)


def test_motions_start_on_the_floor_and_stay_apart_and_in_order_at_every_moment(walk):
    several = [moved(walk, 0.5), moved(walk, -0.5), walk, walk.crop(0, 5), moved(walk, 1.0)]
    shifts = places(several)
    for moment in np.arange(0, walk.duration, 0.1):
        frames = [min(int(moment * motion.fps), motion.frames - 1) for motion in several]
        found = [m.positions[f] + shift for m, f, shift in zip(several, frames, shifts, strict=True)]
        assert all(a[:, 0].max() + 0.3 < b[:, 0].min() for a, b in pairwise(found)), moment
    assert all(
        (m.positions[..., 1] + s[1]).min() == pytest.approx(0, abs=1e-6) for m, s in zip(several, shifts, strict=True)
    )
    assert all((m.positions[0, 0] + s)[2] == pytest.approx(0, abs=1e-6) for m, s in zip(several, shifts, strict=True))
    assert places([]) == []


def test_alike_motions_stand_near_each_other_however_far_they_go(walk):
    far = moved(walk, 5.0)
    first, second = places([far, far])
    assert second[0] - first[0] < 2.5


def test_the_way_is_smooth_and_on_the_floor(walk):
    steady = np.arange(60.0)[:, None] * [0.1, 0.2]
    assert smoothed(steady, 20)[10:-10] == pytest.approx(steady[10:-10])
    assert smoothed(np.ones((3, 2)), 20) == pytest.approx(np.ones((3, 2)))
    assert smoothed(np.ones((1, 2)), 20).shape == (1, 2)
    way = way_of(walk, np.array([1.0, 5.0, 2.0]))
    assert way.shape == (walk.frames, 3)
    assert (way[:, 1] == 0).all()
    assert np.abs(way - walk.positions[:, 0] - [1, 0, 2])[:, [0, 2]].max() < 0.5


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (390, 844), (900, 300)])
def test_all_points_are_in_view_and_fill_it(width, height):
    points = np.random.default_rng(0).uniform([-2, 0, -1], [2, 1.8, 1], (200, 3))
    position, target = viewpoint(points, 0.9, width, height)
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, [0, 1, 0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    depth = (points - position) @ forward
    x = (points - position) @ right / depth / (np.tan(0.45) * width / height)
    y = (points - position) @ up / depth / np.tan(0.45)
    assert depth.min() > 0
    assert np.abs(x).max() <= 0.86
    assert y.max() <= 1
    lowest = 1 - 2 * 0.42 if width < 576 else -1  # on a phone the controls cover the lower part
    assert y.min() >= lowest
    assert max(np.abs(x).max(), np.abs(y).max()) > 0.7
