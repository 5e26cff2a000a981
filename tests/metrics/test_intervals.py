"""Intervals over repetitions, seeds and items."""

import subprocess
import sys

import numpy as np
import pytest

from motionary.metrics import interval, paired_bootstrap, paired_interval


def test_interval_of_known_values():
    result = interval([1, 3] * 10)
    assert (result.mean, result.half) == pytest.approx((2, 1.96 / np.sqrt(20)))
    assert result.low == pytest.approx(2 - result.half)
    assert str(interval([1.0])) == "1.000 ± 0.000"


@pytest.mark.parametrize("n", [2, 3, 5, 11, 12, 40, 1000])
def test_paired_interval_is_that_of_scipy(n):
    stats = pytest.importorskip("scipy.stats")
    a, b = np.random.default_rng(n).normal(size=(2, n))
    found = paired_interval(a, b)
    expected = stats.ttest_rel(a, b).confidence_interval(0.95)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high), abs=1e-9)


def test_metrics_load_scipy_only_where_an_interval_needs_it():
    code = "import sys, motionary, motionary.metrics; sys.exit('scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_paired_interval_of_three_seeds_uses_students_t():
    result = paired_interval([3, 4, 5], [1, 3, 2])  # differences 2, 1, 3
    assert (result.mean, result.half) == pytest.approx((2, 4.3027 / np.sqrt(3)), rel=1e-4)
    assert np.isnan(paired_interval([1], [2]).half)


@pytest.mark.parametrize("n", [3, 12, 40])
def test_paired_interval_covers_the_truth_95_times_in_100(n):
    rng = np.random.default_rng(n)
    covered = 0
    for _ in range(2000):
        a = rng.normal(size=n)
        shared = paired_interval(a + rng.normal(0.5, 1, n), a)
        covered += shared.low <= 0.5 <= shared.high
    assert covered / 2000 == pytest.approx(0.95, abs=0.015)


def test_bootstrap_agrees_with_the_normal_interval_on_many_items():
    rng = np.random.default_rng(0)
    a = rng.normal(1, 1, 1000)
    mean, low, high = paired_bootstrap(a, np.zeros(1000), draws=2000, generator=np.random.default_rng(1))
    assert mean == pytest.approx(a.mean())
    assert high - low == pytest.approx(2 * 1.96 * a.std() / np.sqrt(1000), rel=0.1)
    assert paired_bootstrap(a, a, draws=10) == (0, 0, 0)
