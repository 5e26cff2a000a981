"""Scores of judged motions over the protocol's repetitions, for all items and for each part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from motionary.errors import MOST, InputError
from motionary.metrics.distribution import diversity, frechet_distance, halves_distance
from motionary.metrics.intervals import interval
from motionary.metrics.retrieval import multimodal_distance, r_precision


@dataclass(frozen=True)
class Protocol:
    """Settings of the evaluation (conf/evaluation.yaml documents each)."""

    repetitions: int = 20
    pool: int = 32
    diversity_pairs: int = 300
    multimodality_texts: int = 100
    multimodality_samples: int = 30
    multimodality_pairs: int = 10
    generation_repetitions: int = 1
    prompt_samples: int = 10
    batch_size: int = 64
    position_samples: int = 10
    position_items: int = 0
    bert_score: bool = True
    real_lengths: bool = True

    def __post_init__(self):
        for name, value in vars(self).items():
            least = 0 if name.startswith("position_") else 1
            if not isinstance(value, bool) and not least <= value <= MOST:
                raise InputError(f"evaluation.{name}", value, f"must be in {least}..{MOST}")
        if self.multimodality_samples < 2 * self.multimodality_pairs:
            rule = f"must be at least twice multimodality_pairs ({self.multimodality_pairs})"
            raise InputError("evaluation.multimodality_samples", self.multimodality_samples, rule)


def summarize(rows: Sequence[Mapping[str, float]]) -> dict[str, dict[str, float]]:
    """{metric: {"mean", "half"}} over repetitions; half is the 95% interval's half width."""
    return {name: interval([row[name] for row in rows]).report() for name in rows[0]}


def judged(
    text: np.ndarray, motion: np.ndarray, real: np.ndarray, protocol: Protocol, rng: np.random.Generator
) -> dict[str, float]:
    """One repetition of the protocol: R-precision, FID, multimodal distance, diversity.

    Args:
        text, motion, real: (N, E) features of each item's caption, of the motion made for it, and of its own motion.
        protocol: pool and pairs; both shrink to what the items allow.
        rng: shuffles the pools and draws the pairs.
    """
    order = rng.permutation(len(text))
    pool = min(protocol.pool, len(text))
    top = r_precision(text[order], motion[order], top_k=min(3, pool), pool=pool)
    values = {f"r{k + 1}": float(value) for k, value in enumerate(top)}
    values["fid"] = frechet_distance(motion, real)
    values["fid_real_halves"] = halves_distance(real, rng) if len(real) >= 4 else float("nan")
    values["mm_dist"] = multimodal_distance(text, motion)
    values["diversity"] = diversity(motion, min(protocol.diversity_pairs, len(motion) // 2), rng)
    return {name: value for name, value in values.items() if np.isfinite(value)}


def judged_parts(
    draws: Sequence[tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]], real: np.ndarray, protocol: Protocol
) -> dict[str, dict[str, Any]]:
    """Rows of the result table for all items and each part.

    Args:
        draws: (text features, motion features, parts) of each independent generation; repetition r uses draw
            r modulo their number.
        real: (N, E) features of the items' own motions.
        protocol: repetitions, pools and pairs.
    """
    rows: dict[str, list[dict[str, float]]] = {}
    counts: dict[str, int] = {}
    for repetition in range(protocol.repetitions):
        text, motion, parts = draws[repetition % len(draws)]
        for name, where in parts.items():
            rng = np.random.default_rng([repetition, 23])
            rows.setdefault(name, []).append(judged(text[where], motion[where], real[where], protocol, rng))
            counts[name] = len(where)
    return {
        name: {"items": counts[name], "pool": min(protocol.pool, counts[name]), **summarize(values)}
        for name, values in rows.items()
    }
