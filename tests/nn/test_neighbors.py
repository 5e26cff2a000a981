"""The nearest vectors, against every distance written out."""

from __future__ import annotations

import numpy as np

from motionary.nn.neighbors import nearest


def test_nearest_first():
    rng = np.random.default_rng(0)
    queries, candidates = rng.normal(size=(5, 4)), rng.normal(size=(9, 4))
    away = np.linalg.norm(queries[:, None] - candidates[None], axis=-1)
    np.testing.assert_array_equal(nearest(queries, candidates, 3), np.argsort(away, axis=1)[:, :3])
    assert nearest(queries, candidates, 20).shape == (5, 9)
    assert nearest(candidates, candidates)[:, 0].tolist() == list(range(9))
