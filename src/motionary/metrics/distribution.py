"""How far two sets of motion features lie apart, and how spread one set is.

Features are rows of the motion extractor of the evaluator, shape (N, D). Definitions: TM2T appendix C, thesis 4.4.1.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from motionary.errors import InputError
from motionary.metrics.inputs import matrix


def frechet_distance(a: Any, b: Any) -> float:
    """Frechet distance of the Gaussians fitted to two sets of features ("FID").

    |mean_a - mean_b|^2 + trace(C_a) + trace(C_b) - 2 trace((C_a C_b)^1/2), with unbiased covariances.

    Args:
        a: (N, D) features, N >= 2.
        b: (M, D) features, M >= 2.

    Returns:
        A number >= 0 in squared units of the features. It depends on the extractor and, for small sets, on N and M:
        compare it within one extractor only, beside `halves_distance` of the real features.

    The trace of the root needs no matrix square root: with C_a = R^T R, the product C_a C_b has the eigenvalues of the
    symmetric R C_b R^T, and the trace of its root is the sum of their roots.
    """
    a, b = matrix("a", a), matrix("b", b)
    if a.shape[1] != b.shape[1]:
        raise InputError("a, b", f"{a.shape} and {b.shape}", "must have the same number of features")
    mean_a, covariance_a, root = _moments("a", a)
    mean_b, covariance_b, _ = _moments("b", b, root=False)
    product = root @ covariance_b @ root.T
    root_trace = np.sqrt(np.clip(np.linalg.eigvalsh(product), 0, None)).sum()
    distance = np.square(mean_a - mean_b).sum() + np.trace(covariance_a) + np.trace(covariance_b) - 2 * root_trace
    return float(max(distance, 0.0))


def halves_distance(x: Any, generator: np.random.Generator) -> float:
    """Frechet distance of two random halves of one set: the floor that a perfect generator meets at this sample size.

    Args:
        x: (N, D) features of real motion, N >= 4.
        generator: draws the halves.
    """
    x = matrix("x", x)
    if len(x) < 4:
        raise InputError("x", x.shape, "needs at least 4 rows to be halved")
    order = generator.permutation(len(x))
    return frechet_distance(x[order[: len(x) // 2]], x[order[len(x) // 2 :]])


def diversity(x: Any, pairs: int = 300, generator: np.random.Generator | None = None) -> float:
    """Mean distance of `pairs` random pairs of features (TM2T appendix C).

    Two subsets of the same number of rows are drawn, each without repetition, and paired in the order drawn; a row can
    stand in both, as in the released evaluation.

    Args:
        x: (N, D) features of motions of all descriptions.
        pairs: pairs drawn, 1..N (papers: 300).
        generator: draws the subsets; seed 0 where None.
    """
    x = matrix("x", x)
    if not 1 <= pairs <= len(x):
        raise InputError("pairs", pairs, f"must lie in 1..{len(x)}, the number of rows of x")
    generator = generator or np.random.default_rng(0)
    first = generator.choice(len(x), pairs, replace=False)
    second = generator.choice(len(x), pairs, replace=False)
    return float(np.linalg.norm(x[first] - x[second], axis=1).mean())


def multimodality(x: Any, pairs: int = 10, generator: np.random.Generator | None = None) -> float:
    """Mean distance of random pairs of features that belong to one description (TM2T appendix C).

    For every description two subsets of `pairs` samples are drawn, each without repetition, as in the released
    evaluation (which draws the same sample numbers for all descriptions; here each has its own draw).

    Args:
        x: (C, S, D) features: C descriptions, S samples each (papers: 100 x 30).
        pairs: pairs per description, 1..S (papers: 10).
        generator: draws the subsets; seed 0 where None.
    """
    x = matrix("x", x, 3)
    texts, samples = x.shape[:2]
    if not 1 <= pairs <= samples:
        raise InputError("pairs", pairs, f"must lie in 1..{samples}, the samples of each description")
    generator = generator or np.random.default_rng(0)
    draws = np.argsort(generator.random((2, texts, samples)), axis=-1)[..., :pairs]  # (2, C, pairs) without repetition
    rows = np.arange(texts)[:, None]
    return float(np.linalg.norm(x[rows, draws[0]] - x[rows, draws[1]], axis=-1).mean())


def _moments(what: str, x: np.ndarray, root: bool = True) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean (D,), unbiased covariance C (D, D) and, on request, a root R (K, D) with R^T R = C."""
    if len(x) < 2:
        raise InputError(what, x.shape, "needs at least 2 rows for a covariance")
    x = x.astype(np.float64)
    mean = x.mean(0)
    centered = x - mean
    covariance = centered.T @ centered / (len(x) - 1)
    if not root:
        return mean, covariance, covariance
    if len(x) <= x.shape[1]:  # few rows: they are a root themselves, and a smaller one
        return mean, covariance, centered / np.sqrt(len(x) - 1)
    try:
        return mean, covariance, np.linalg.cholesky(covariance).T
    except np.linalg.LinAlgError:  # features that depend on each other
        values, vectors = np.linalg.eigh(covariance)
        return mean, covariance, np.sqrt(np.clip(values, 0, None))[:, None] * vectors.T
