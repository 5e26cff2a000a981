"""Whittaker's smoother against its normal equations."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.motion.smoothing import smoothest


@pytest.mark.parametrize("frames", [1, 2, 3, 4, 40])
def test_it_solves_the_normal_equations(frames):
    rng = np.random.default_rng(frames)
    weights, values = rng.random(frames) + 0.1, rng.normal(size=(frames, 3))
    bends = np.diff(np.eye(frames), 2, axis=0) if frames > 2 else np.zeros((0, frames))
    wanted = np.linalg.solve(np.diag(weights) + 7 * bends.T @ bends, weights[:, None] * values)
    np.testing.assert_allclose(smoothest(values, weights, 7.0), wanted, atol=1e-12)


def test_what_lies_on_a_line_stays_and_gaps_are_bridged():
    line = np.arange(50.0)[:, None] * [1, -2]
    np.testing.assert_allclose(smoothest(line, np.ones(50), 1e4), line, atol=1e-8)
    weights = np.ones(50)
    weights[10:40] = 0
    np.testing.assert_allclose(smoothest(np.where(weights[:, None] > 0, line, 99), weights, 1.0), line, atol=1e-6)
