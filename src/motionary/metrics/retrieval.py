"""How well texts and motions find each other in the evaluator's common space (TM2T 4, thesis 4.4.1)."""

from __future__ import annotations

from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.metrics.inputs import matrix, same_shape

_TIE = 1e-5  # of the mean squared distance in the pool: what float32 features of one caption differ by between batches


def r_precision(text: Any, motion: Any, top_k: int = 3, pool: int = 32, keys: Any = None) -> np.ndarray:
    """Share of rows whose own partner is among the nearest 1..top_k of a pool, by Euclidean distance.

    Row i of `text` belongs to row i of `motion`. Consecutive rows form the pools (shuffle before each repetition), the
    last incomplete pool is dropped as in the papers; with fewer rows than `pool` all of them form one smaller pool.
    Each row of `text` ranks the motions of its pool; call with the arguments swapped to rank texts by motions.

    Candidates as far away as the partner (equal captions, where texts are the candidates) share their places: each
    order of them is equally likely, and the chance that the partner comes out in time is counted. So a constant
    extractor scores chance, k / pool, and the order of the rows within a pool does not matter.

    Args:
        text: (N, D) query features.
        motion: (N, D) candidate features.
        top_k: number of places reported, 1..pool.
        pool: candidates for each query.
        keys: (N,) optional ids of captions; a candidate whose id equals the query's counts as right too. None (papers)
            counts only the row's own partner.

    Returns:
        (top_k,) float64, non-decreasing: precision at 1, ..., top_k.
    """
    text, motion = matrix("text", text), matrix("motion", motion)
    same_shape("text, motion", text, motion)
    pool = min(pool, len(text))
    if not 1 <= top_k <= pool:
        raise InputError("top_k", top_k, f"must lie in 1..{pool}, the rows of a pool")
    pools = len(text) // pool
    used = pools * pool
    distance = _distances(text[:used].reshape(pools, pool, -1), motion[:used].reshape(pools, pool, -1))
    if keys is None:
        right = np.broadcast_to(np.eye(pool, dtype=bool), distance.shape)
    else:
        keys = np.asarray(keys)
        if keys.shape != (len(text),):
            raise InputError("keys", keys.shape, f"must be one id per row, ({len(text)},)")
        keys = keys[:used].reshape(pools, pool)
        right = keys[:, :, None] == keys[:, None, :]
    best = np.where(right, distance, np.inf).min(-1, keepdims=True)
    # Only the wrong ones compete, so that a second right candidate does not push the first back.
    slack = _TIE * distance.mean(-1, keepdims=True)
    nearer = ((distance < best - slack) & ~right).sum(-1)[..., None]
    tied = np.abs(distance - best) <= slack
    tied_wrong, tied_right = (tied & ~right).sum(-1)[..., None], (tied & right).sum(-1)[..., None]
    return _hit_chance(np.arange(1, top_k + 1) - nearer, tied_wrong, tied_right).mean((0, 1))


def multimodal_distance(text: Any, motion: Any) -> float:
    """Mean Euclidean distance of each text feature to its own motion's (TM2T appendix C: "MM Dist").

    Args:
        text: (N, D) features.
        motion: (N, D) features of the same rows.
    """
    text, motion = matrix("text", text), matrix("motion", motion)
    same_shape("text, motion", text, motion)
    return float(np.linalg.norm(text - motion, axis=1).mean())


def own_ranks(text: Any, motion: Any) -> np.ndarray:
    """(N,) place of each text's own motion among all motions by Euclidean distance, 1 the nearest; ties share the mean
    of their places.

    Args:
        text: (N, D) query features.
        motion: (N, D) candidate features of the same rows.
    """
    text, motion = matrix("text", text), matrix("motion", motion)
    same_shape("text, motion", text, motion)
    distance = _distances(text[None].astype(np.float64), motion[None].astype(np.float64))[0]
    own, slack = np.diagonal(distance)[:, None], _TIE * distance.mean(-1, keepdims=True)
    nearer = (distance < own - slack).sum(-1)
    tied = (np.abs(distance - own) <= slack).sum(-1)  # itself included
    return nearer + (tied + 1) / 2


def rank_correlation(a: Any, b: Any) -> float:
    """Spearman's correlation of two rankings of the same items; 0 where one tells no two items apart.

    Args:
        a, b: (N,) values, N >= 2.
    """
    from scipy.stats import rankdata  # late: with scipy, `import motionary` would take longer

    a, b = matrix("a", a, 1), matrix("b", b, 1)
    same_shape("a, b", a, b)
    ranks = [rank - rank.mean() for rank in (rankdata(a), rankdata(b))]
    norm = float(np.linalg.norm(ranks[0]) * np.linalg.norm(ranks[1]))
    return float(ranks[0] @ ranks[1]) / norm if norm else 0.0


def _distances(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Squared distances (P, n, n) of (P, n, D) queries and candidates, centered first so that cancellation is small."""
    center = b.mean(axis=(0, 1))
    a, b = a - center, b - center
    squares = np.square(a).sum(-1)[:, :, None] + np.square(b).sum(-1)[:, None, :]
    return squares - 2 * np.matmul(a, b.transpose(0, 2, 1))


def _hit_chance(places: np.ndarray, wrong: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Chance that `places` draws without repetition from `wrong` + `right` tied candidates hit a right one."""
    places = np.clip(places, 0, None)
    miss = np.ones(np.broadcast_shapes(places.shape, wrong.shape))
    total = wrong + right
    for drawn in range(int(places.max(initial=0))):
        left = np.clip(wrong - drawn, 0, None) / np.clip(total - drawn, 1, None)
        miss = np.where(drawn < places, miss * left, miss)
    return 1 - miss
