"""Scores of motions and captions: distributions, retrieval, positions, physics, language.

Names are handed on lazily, so that importing one metric loads only what it needs (numpy, for all but language).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from motionary.lazy import hand_on

if TYPE_CHECKING:
    from motionary.metrics.captions import bert_score, bleu, bleu_interval, caption_scores, cider, rouge_l
    from motionary.metrics.classification import accuracy, macro_accuracy
    from motionary.metrics.distribution import diversity, frechet_distance, halves_distance, multimodality
    from motionary.metrics.intervals import Interval, interval, paired_bootstrap, paired_interval
    from motionary.metrics.physics import bone_change, floating, foot_skating, jitter, penetration, physics
    from motionary.metrics.position import (
        PositionErrors,
        average_position_error,
        average_variance_error,
        geodesic_distance,
        mpjpe,
        position_errors,
    )
    from motionary.metrics.retrieval import multimodal_distance, own_ranks, r_precision, rank_correlation

__all__ = [
    "Interval",
    "PositionErrors",
    "accuracy",
    "average_position_error",
    "average_variance_error",
    "bert_score",
    "bleu",
    "bleu_interval",
    "bone_change",
    "caption_scores",
    "cider",
    "diversity",
    "floating",
    "foot_skating",
    "frechet_distance",
    "geodesic_distance",
    "halves_distance",
    "interval",
    "jitter",
    "macro_accuracy",
    "mpjpe",
    "multimodal_distance",
    "multimodality",
    "own_ranks",
    "paired_bootstrap",
    "paired_interval",
    "penetration",
    "physics",
    "position_errors",
    "r_precision",
    "rank_correlation",
    "rouge_l",
]
_NAMES = {
    "classification": ("accuracy", "macro_accuracy"),
    "captions": ("bert_score", "bleu", "bleu_interval", "caption_scores", "cider", "rouge_l"),
    "distribution": ("diversity", "frechet_distance", "halves_distance", "multimodality"),
    "intervals": ("Interval", "interval", "paired_bootstrap", "paired_interval"),
    "physics": ("bone_change", "floating", "foot_skating", "jitter", "penetration"),
    "position": (
        "PositionErrors",
        "average_position_error",
        "average_variance_error",
        "geodesic_distance",
        "mpjpe",
        "position_errors",
    ),
    "retrieval": ("multimodal_distance", "own_ranks", "r_precision", "rank_correlation"),
}
_HOMES = {name: f"{__name__}.{part}" for part, names in _NAMES.items() for name in (part, *names)}
__getattr__, __dir__ = hand_on(__name__, _HOMES)
