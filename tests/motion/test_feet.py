"""Two-bone IK by the laws of the triangle, and feet that stand."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.motion.feet import held_feet, standing, two_bone


@pytest.fixture
def leg():
    """Hips, knees and ankles (50, 3) of legs bent at random, and goals within their reach."""
    rng = np.random.default_rng(0)
    hip = rng.normal(size=(50, 3))
    knee = hip + 0.4 * unit(rng.normal(size=(50, 3)))
    ankle = knee + 0.45 * unit(rng.normal(size=(50, 3)))
    goal = hip + rng.uniform(0.2, 0.8, (50, 1)) * unit(rng.normal(size=(50, 3)))
    return hip, knee, ankle, goal


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def applied(hip, knee, ankle, thigh, shin):
    new_knee = hip + np.einsum("tij,tj->ti", thigh, knee - hip)
    return new_knee, new_knee + np.einsum("tij,tj->ti", shin, ankle - knee)


def test_the_ankle_comes_to_its_goal(leg):
    hip, knee, ankle, goal = leg
    thigh, shin = two_bone(hip, knee, ankle, goal)
    np.testing.assert_allclose(applied(hip, knee, ankle, thigh, shin)[1], goal, atol=1e-9)
    for turn in (thigh, shin):
        np.testing.assert_allclose(turn @ turn.swapaxes(-1, -2), np.tile(np.eye(3), (50, 1, 1)), atol=1e-9)
        np.testing.assert_allclose(np.linalg.det(turn), 1)


def test_the_knee_stays_in_its_plane_when_the_goal_is_on_the_line(leg):
    hip, knee, ankle, _ = leg
    goal = hip + 0.9 * (ankle - hip)
    new_knee, _ = applied(hip, knee, ankle, *two_bone(hip, knee, ankle, goal))
    normal = np.cross(knee - hip, ankle - hip)
    np.testing.assert_allclose(((new_knee - hip) * normal).sum(-1), 0, atol=1e-9)
    side = ((new_knee - hip) * (knee - hip)).sum(-1)
    assert (side > 0).all()


def test_an_ankle_at_its_goal_does_not_move(leg):
    hip, knee, ankle, _ = leg
    straight = hip + 0.85 / 0.4 * (knee - hip)
    for end in (ankle, straight):
        for turn in two_bone(hip, knee, end, end):
            np.testing.assert_allclose(turn, np.tile(np.eye(3), (50, 1, 1)), atol=1e-5)


def test_goals_out_of_reach_are_approached_and_straight_legs_are_finite():
    hip, knee, ankle = np.array([[0, 1.0, 0]]), np.array([[0, 0.5, 0]]), np.array([[0, 0.0, 0]])
    for goal in ([[0, -5.0, 0]], [[0, 1.0, 0]], [[0, 0.5, 0]], [[3, 1, 0]]):
        found = applied(hip, knee, ankle, *two_bone(hip, knee, ankle, np.array(goal)))
        assert np.isfinite(found).all()
    far = applied(hip, knee, ankle, *two_bone(hip, knee, ankle, np.array([[5.0, 1, 0]])))[1]
    np.testing.assert_allclose(far, [[1, 1, 0]], atol=2e-3)


def test_a_foot_stands_while_it_is_low_and_slow():
    foot = np.zeros((60, 3))
    foot[20:40, 1] = 0.15 * np.sin(np.linspace(0, np.pi, 20))
    foot[20:40, 2] = np.linspace(0, 0.8, 20)
    foot[40:, 2] = 0.8
    stands = standing(foot, 20)
    assert (stands[:19] == 1).all()
    assert (stands[42:] == 1).all()
    assert stands[24:36].max() < 0.1


def test_the_body_goes_with_the_one_foot_that_stands():
    """The right foot stands and slides in the pose: the root takes that back, and the legs have nothing left to do."""
    time = np.arange(40) / 20
    right = np.zeros((40, 3))
    left = np.stack([0 * time, 0.2 + 0 * time, 2 * time], -1)
    left[:3, 1] = 0  # it stood before
    slide = np.stack([0.1 * time, 0 * time, 0 * time], -1)
    moves, body = held_feet([left, right], [left, right + slide], 20)
    np.testing.assert_allclose((right + slide + body + moves[1])[5:], right[5:], atol=2e-3)
    assert np.abs(moves[1][5:]).max() < 0.005
