"""Retrieval against perfect, chance and tied cases."""

import numpy as np
import pytest

from motionary.errors import InputError
from motionary.metrics import multimodal_distance, own_ranks, r_precision, rank_correlation


def features(rows=320, dim=16, seed=0):
    return np.random.default_rng(seed).normal(size=(rows, dim)).astype(np.float32)


def test_perfect_retrieval():
    x = features()
    np.testing.assert_array_equal(r_precision(x, x), [1, 1, 1])
    np.testing.assert_array_equal(r_precision(x + 1000, x + 1000), [1, 1, 1])


def test_unrelated_features_retrieve_at_chance():
    value = r_precision(features(32 * 400, seed=1), features(32 * 400, seed=2))
    np.testing.assert_allclose(value, np.arange(1, 4) / 32, rtol=0.12)


def test_a_constant_extractor_scores_chance_exactly():
    np.testing.assert_allclose(r_precision(np.ones((64, 5)), np.ones((64, 5)), top_k=32), np.arange(1, 33) / 32)


def test_definition_by_loops():
    text = features(100, seed=3)
    motion = text + 1.5 * features(100, seed=4)
    hits = np.zeros(5)
    for start in range(0, 96, 32):
        for i in range(start, start + 32):
            distances = [np.linalg.norm(text[i] - motion[j]) for j in range(start, start + 32)]
            rank = sorted(range(32), key=distances.__getitem__).index(i - start)
            hits += rank < np.arange(1, 6)
    np.testing.assert_allclose(r_precision(text, motion, top_k=5), hits / 96)


def test_last_incomplete_pool_is_dropped_and_small_sets_shrink_the_pool():
    x = features(70, seed=5)
    y = x.copy()
    y[64:] = -x[64:]  # wrong in the dropped rows only
    np.testing.assert_array_equal(r_precision(x, y), [1, 1, 1])
    np.testing.assert_allclose(r_precision(np.ones((10, 2)), np.ones((10, 2))), [0.1, 0.2, 0.3])


def test_order_within_pools_and_rotation_of_the_space_do_not_matter():
    text = features(96, seed=6)
    motion = text + features(96, seed=7)
    order = np.concatenate([32 * p + np.random.default_rng(p).permutation(32) for p in range(3)])
    rotation, _ = np.linalg.qr(np.random.default_rng(8).normal(size=(16, 16)))
    expected = r_precision(text, motion)
    np.testing.assert_allclose(r_precision(text[order], motion[order]), expected)
    np.testing.assert_allclose(r_precision(text @ rotation, motion @ rotation), expected)


def test_equal_captions_share_their_places_or_count_as_right():
    # Motions as queries, texts as candidates: pairs of rows carry the same caption.
    text = np.repeat(features(16, seed=9), 2, axis=0)
    motion = text + 0.01 * features(32, seed=10)
    np.testing.assert_allclose(r_precision(motion, text), [0.5, 1, 1])
    np.testing.assert_allclose(r_precision(motion, text, keys=np.arange(32) // 2), [1, 1, 1])
    # Another row of the same caption does not push the own one back either.
    np.testing.assert_allclose(r_precision(text, motion, keys=np.arange(32) // 2), [1, 1, 1])


def test_multimodal_distance_of_known_offsets():
    x = features(8, 2)
    assert multimodal_distance(x, x + np.array([3, 4])) == pytest.approx(5, rel=1e-6)
    assert multimodal_distance(x, x) == 0


@pytest.mark.parametrize(
    "call",
    [
        lambda: r_precision(features(32), features(33)),
        lambda: r_precision(features(2), features(2), top_k=3),
        lambda: r_precision(features(32), features(32), keys=[1, 2]),
        lambda: multimodal_distance(features(3), features(4)),
    ],
)
def test_bad_input_is_named(call):
    with pytest.raises(InputError):
        call()


def test_own_ranks_in_closed_form_with_ties():
    text = np.array([[0.0], [1.0], [5.0], [9.0]])
    motion = np.array([[0.4], [0.4], [4.0], [20.0]])
    assert own_ranks(text, motion).tolist() == [1.5, 1.5, 1.0, 4.0]
    assert own_ranks(np.zeros((5, 2)), np.zeros((5, 2))).tolist() == [3.0] * 5


def test_rank_correlation_is_spearman_s():
    from scipy.stats import spearmanr

    rng = np.random.default_rng(0)
    a, b = rng.integers(0, 9, 50), rng.integers(0, 9, 50)
    assert rank_correlation(a, b) == pytest.approx(spearmanr(a, b).statistic)
    assert rank_correlation([1, 2, 4], [3, 30, 300]) == pytest.approx(1)
    assert rank_correlation([1, 2, 4], [3, 2, 1]) == pytest.approx(-1)
    assert rank_correlation([1, 2, 4], [7, 7, 7]) == 0
