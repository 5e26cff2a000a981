"""Frechet distance, diversity and multimodality against closed forms."""

import numpy as np
import pytest

from motionary.errors import InputError
from motionary.metrics import diversity, frechet_distance, halves_distance, multimodality


def gaussian(rows, mean, covariance, seed):
    """Rows whose sample mean and unbiased covariance are exactly those given."""
    x = np.random.default_rng(seed).normal(size=(rows, len(mean)))
    x -= x.mean(0)
    x = x @ np.linalg.inv(np.linalg.cholesky(np.cov(x.T))).T
    return x @ np.linalg.cholesky(np.asarray(covariance)).T + mean


def random_covariance(dim, seed):
    a = np.random.default_rng(seed).normal(size=(dim, dim))
    return a @ a.T / dim + 0.1 * np.eye(dim)


def test_fid_of_gaussians_that_commute_is_a_sum_over_axes():
    sigma_a, sigma_b = np.array([1.0, 2.0, 3.0]), np.array([2.0, 0.5, 3.0])
    a = gaussian(200, [0, 1, 2], np.diag(sigma_a**2), 0)
    b = gaussian(300, [3, 1, 6], np.diag(sigma_b**2), 1)
    assert frechet_distance(a, b) == pytest.approx(25 + ((sigma_a - sigma_b) ** 2).sum(), rel=1e-9)


def test_fid_of_any_gaussians_matches_the_matrix_square_root():
    dim = 6
    cov_a, cov_b = random_covariance(dim, 2), random_covariance(dim, 3)
    values, vectors = np.linalg.eigh(cov_a)
    root_a = vectors * np.sqrt(values) @ vectors.T
    inner = np.sqrt(np.linalg.eigvalsh(root_a @ cov_b @ root_a)).sum()
    expected = 4 * dim + np.trace(cov_a) + np.trace(cov_b) - 2 * inner
    a, b = gaussian(400, np.zeros(dim), cov_a, 4), gaussian(500, np.full(dim, 2.0), cov_b, 5)
    assert frechet_distance(a, b) == pytest.approx(expected, rel=1e-9)
    assert frechet_distance(b, a) == pytest.approx(expected, rel=1e-9)


def test_fid_of_large_samples_nears_the_truth():
    rng = np.random.default_rng(6)
    a, b = rng.normal(0, 1, (40_000, 3)), rng.normal(1, 2, (40_000, 3))
    assert frechet_distance(a, b) == pytest.approx(3 * (1 + 1), rel=0.03)


@pytest.mark.parametrize("rows", [10, 600])
def test_fid_of_a_set_with_itself_is_zero_in_any_order(rows):
    x = np.random.default_rng(7).normal(size=(rows, 64)).astype(np.float32)
    assert frechet_distance(x, x[::-1]) == pytest.approx(0, abs=1e-5)


def test_fid_of_dependent_and_of_few_features_is_right():
    rng = np.random.default_rng(8)
    flat = np.repeat(rng.normal(size=(100, 3)), 2, axis=1)  # every feature twice: a singular covariance
    assert frechet_distance(flat, flat + 1) == pytest.approx(6, rel=1e-5)
    wide = rng.normal(size=(20, 50))
    assert frechet_distance(wide, 3 * wide) == pytest.approx(
        np.square(2 * wide.mean(0)).sum() + 4 * np.trace(np.cov(wide.T)), rel=1e-6
    )


def test_fid_takes_torch_tensors_that_carry_gradients():
    torch = pytest.importorskip("torch")
    x = torch.randn(50, 4, generator=torch.Generator().manual_seed(0), requires_grad=True)
    assert frechet_distance(x, x + 2) == pytest.approx(16, rel=1e-4)


def test_halves_of_one_gaussian_are_near_and_seeded():
    x = np.random.default_rng(9).normal(size=(2000, 8))
    distance = halves_distance(x, np.random.default_rng(1))
    assert 0 < distance < 0.2
    assert distance == halves_distance(x, np.random.default_rng(1))


def test_diversity_of_two_points_is_half_their_distance():
    x = np.zeros((4000, 3))
    x[::2] = [3, 0, 4]
    assert diversity(x, 4000, np.random.default_rng(0)) == pytest.approx(2.5, rel=0.05)
    assert diversity(x + 7, 4000, np.random.default_rng(0)) == diversity(x, 4000, np.random.default_rng(0))
    assert diversity(np.ones((5, 2)), 5, np.random.default_rng(0)) == 0


def test_multimodality_sees_the_spread_within_descriptions_only():
    between = np.random.default_rng(1).normal(size=(50, 1, 4)) * 100
    assert multimodality(np.repeat(between, 30, axis=1), 10, np.random.default_rng(0)) == 0
    within = np.zeros((400, 30, 4))
    within[:, ::2, 0] = 2  # half of the samples lie 2 apart, so the mean over pairs is 1
    assert multimodality(between[:1] + within, 10, np.random.default_rng(0)) == pytest.approx(1, rel=0.05)


def test_multimodality_draws_without_repetition():
    x = np.random.default_rng(2).normal(size=(6, 2, 3))
    # Both samples of a description are drawn on either side: each pair is (1,1),(2,2) or (1,2),(2,1).
    distance = np.linalg.norm(x[:, 0] - x[:, 1], axis=-1)
    value = multimodality(x, 2, np.random.default_rng(3)) * 6
    sums = {round(float((distance * mask).sum()), 9) for mask in np.indices((2,) * 6).reshape(6, -1).T}
    assert round(value, 9) in sums


@pytest.mark.parametrize(
    "call",
    [
        lambda: frechet_distance(np.ones((1, 4)), np.ones((5, 4))),
        lambda: frechet_distance(np.ones((5, 3)), np.ones((5, 4))),
        lambda: frechet_distance(np.full((5, 3), np.nan), np.ones((5, 3))),
        lambda: diversity(np.ones((5, 3)), 6, np.random.default_rng(0)),
        lambda: diversity(np.ones(5), 1, np.random.default_rng(0)),
        lambda: multimodality(np.ones((5, 3, 2)), 4, np.random.default_rng(0)),
        lambda: halves_distance(np.ones((3, 3)), np.random.default_rng(0)),
    ],
)
def test_bad_input_is_named(call):
    with pytest.raises(InputError) as error:
        call()
    assert "\n" not in str(error.value)
