"""Motions joined, filled in, closed to loops, led along paths and through poses, by the laws that they must keep."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from strides import walker

from motionary.errors import InputError
from motionary.metrics.physics import foot_skating
from motionary.motion import Motion, heading
from motionary.motion.joining import filled, interpolated, joined, looped, stretched
from motionary.motion.kinematics import agrees
from motionary.motion.paths import along, checked_path, length_of
from motionary.motion.pinning import bent, extrapolated, on_body, pinned, placed_at


def jerk(motion: Motion) -> np.ndarray:
    """(T - 3,) mean over the joints, m/s^3."""
    return np.linalg.norm(np.diff(motion.positions.astype(np.float64), n=3, axis=0), axis=-1).mean(1) * motion.fps**3


@pytest.fixture(scope="module")
def walk() -> Motion:
    return walker(seconds=3)


def test_motions_follow_each_other_without_a_seam(walk):
    other = placed_at(walk.crop(7, 60), 0, np.array([5, 0, -3]), 2.0)
    whole = joined([walk, other, walk])
    assert whole.frames == 60 + 53 + 60
    assert agrees(whole)
    assert jerk(whole).max() < 2 * jerk(walk).max()
    speed = np.linalg.norm(np.diff(whole.positions[:, 0], axis=0), axis=-1) * whole.fps
    np.testing.assert_allclose(speed, 0.9, atol=0.05)
    np.testing.assert_allclose(heading(whole), 0, atol=0.02)
    assert foot_skating(whole) < foot_skating(walk) + 0.05


def test_a_piece_fills_a_gap_and_leaves_its_neighbours(walk):
    before, after = walk.crop(0, 20), placed_at(walk.crop(40, 60), 0, np.array([0.3, 0, 1.9]), 0.4)
    piece = filled(placed_at(walk.crop(20, 40), 0, np.array([9, 0, 9]), 1.0), before, after)
    assert piece.frames == 20
    for ours, theirs in ((piece.crop(0, 1), before.crop(19, 20)), (piece.crop(19, 20), after.crop(0, 1))):
        step = np.linalg.norm(ours.positions - theirs.positions, axis=-1)
        assert step.max() < 0.2  # no joint of this walker goes faster than 4 m/s
    whole = Motion(np.concatenate([m.positions for m in (before, piece, after)]), 20, walk.skeleton)
    assert jerk(whole).max() < 2 * jerk(walk).max()
    assert foot_skating(whole) < foot_skating(walk) + 0.05


@pytest.mark.parametrize("seconds", [1.4, 3.0, 2.5])
def test_a_loop_ends_as_it_begins(walk, seconds):
    turned = bent(walk.crop(0, round(seconds * 20)), np.linspace(0, 0.8, round(seconds * 20)), np.zeros(3))
    loop = looped(turned)
    assert loop.frames == turned.frames
    away = (loop.positions[-1, 0] - loop.positions[0, 0]) * [1, 0, 1]
    assert np.linalg.norm(loop.positions[-1] - away - loop.positions[0], axis=-1).max() < 0.02
    first, last = (loop.positions[1] - loop.positions[0]) * 20, (loop.positions[-1] - loop.positions[-2]) * 20
    assert np.linalg.norm(last - first, axis=-1).max() < 0.1
    again = np.concatenate([loop.positions, loop.positions[1:] + away])
    assert jerk(Motion(again, 20, walk.skeleton)).max() < 2.5 * jerk(walk).max()  # it steps out of its rhythm


def test_what_stays_on_the_spot_loops_on_the_spot(walk):
    still = Motion(walk.positions - walk.positions[:, :1] * [1, 0, 1] + [0, 0, 0.003], 20, walk.skeleton)
    loop = looped(still, feet=False)
    np.testing.assert_allclose(loop.positions[-1], loop.positions[0], atol=0.02)
    with pytest.raises(InputError, match="loop: 3 frames"):
        looped(still.crop(0, 3))


def test_pins_are_met_and_fade(walk):
    pose = on_body(walk.crop(33, 34), walk.skeleton)
    pose = placed_at(pose, 0, walk.positions[20, 0] + [0.2, 0, 0.1], 0.5)
    led = pinned(walk, [20], pose)
    np.testing.assert_allclose(led.positions[20], pose.positions[0], atol=1e-3)
    apart = led.positions - walk.positions - (led.positions - walk.positions)[:, :1]
    assert np.linalg.norm(apart[20], axis=-1).max() > 0.2
    assert np.linalg.norm(apart[[0, -1]], axis=-1).max() < 0.1
    np.testing.assert_allclose(led.positions[0, 0], walk.positions[0, 0], atol=0.02)
    np.testing.assert_allclose(led.positions[-1, 0] - walk.positions[-1, 0], [0.2, 0, 0.1], atol=0.03)
    assert jerk(led).max() < 2.5 * jerk(walk).max()
    np.testing.assert_allclose(pinned(walk, [5, 30], walk.crop(5, 7)).positions[5], walk.positions[5], atol=1e-4)


def test_a_path_is_gone_along(walk):
    corner = np.array([[1.0, 1.0], [1.0, 2.0], [2.0, 3.0]])
    for path in (corner, corner[:2] * [1, -2], [[0, 0], [0, 2.7]]):
        line = checked_path(path, 3)
        led = along(walk, line)
        fine = np.concatenate([np.linspace(a, b, 200) for a, b in pairwise(line)])
        away = np.linalg.norm(led.positions[:, 0, None][..., [0, 2]] - fine, axis=-1).min(1)
        assert away.mean() < 0.05
        np.testing.assert_allclose(led.positions[[0, -1], 0][:, [0, 2]], line[[0, -1]], atol=0.1)
        way = line[-1] - line[-2]
        assert np.cos(heading(led)[-5] - np.arctan2(way[0], way[1])) > 0.95
    np.testing.assert_allclose(along(walk, np.array([[0, 0], [0, 2.655]])).positions[:, 0, 0], 0, atol=1e-3)


@pytest.mark.parametrize(
    ("path", "rule"),
    [
        ([[0, 0]], "at least two"),
        ([[0, 0], [0, float("nan")]], "finite"),
        ([[0, 0], [0, 0.01]], "at least 0.05 m long"),
        ([[0, 0], [0, 30]], "a person runs at most 24.0 m"),
        ("straight on", "must be"),
        ([[0, 0, 0, 0]] * 2, "must be"),
        ([[0, 0], [1]], "must be"),
    ],
)
def test_bad_paths_are_one_line(path, rule):
    with pytest.raises(InputError, match=rule):
        checked_path(path, 3)


def test_lengths_and_shortest_ways(walk):
    assert length_of(np.array([[0, 0], [3, 4], [3, 5]])) == 6
    assert stretched(walk, 31).frames == 31
    np.testing.assert_allclose(stretched(walk, 60).positions, walk.positions, atol=1e-5)
    on = extrapolated(walk, 2, 3)
    assert on.frames == 65
    np.testing.assert_allclose(np.diff(on.positions[:, 0], axis=0)[[0, -1]] * 20, [[0, 0, 0.9]] * 2, atol=1e-4)
    way = interpolated(walk.crop(0, 1), walk.crop(59, 60), 9)
    np.testing.assert_allclose(way.positions[4, 0], walk.positions[[0, 59], 0].mean(0), atol=1e-4)
