"""Scores of motions and captions: distributions, retrieval, positions, physics, language, and the oracle.

Names are handed on lazily, so that importing one metric loads only what it needs (numpy, for all but language).
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from motionary.metrics.classification import accuracy, macro_accuracy
    from motionary.metrics.distribution import diversity, frechet_distance, halves_distance, multimodality
    from motionary.metrics.intervals import Interval, interval, paired_bootstrap, paired_interval
    from motionary.metrics.language import bert_score, bleu, bleu_interval, caption_scores, cider, rouge_l
    from motionary.metrics.physics import floating, foot_skating, jitter, penetration
    from motionary.metrics.position import (
        PositionErrors,
        average_position_error,
        average_variance_error,
        geodesic_distance,
        mpjpe,
        position_errors,
    )
    from motionary.metrics.retrieval import multimodal_distance, r_precision

__all__ = [
    "Interval",
    "PositionErrors",
    "accuracy",
    "average_position_error",
    "average_variance_error",
    "bert_score",
    "bleu",
    "bleu_interval",
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
    "paired_bootstrap",
    "paired_interval",
    "penetration",
    "position_errors",
    "r_precision",
    "rouge_l",
]
_PARTS = ("classification", "distribution", "intervals", "language", "oracle", "physics", "position", "retrieval")
_HOMES = {
    "classification": ("accuracy", "macro_accuracy"),
    "distribution": ("diversity", "frechet_distance", "halves_distance", "multimodality"),
    "intervals": ("Interval", "interval", "paired_bootstrap", "paired_interval"),
    "language": ("bert_score", "bleu", "bleu_interval", "caption_scores", "cider", "rouge_l"),
    "physics": ("floating", "foot_skating", "jitter", "penetration"),
    "position": (
        "PositionErrors",
        "average_position_error",
        "average_variance_error",
        "geodesic_distance",
        "mpjpe",
        "position_errors",
    ),
    "retrieval": ("multimodal_distance", "r_precision"),
}


def __getattr__(name: str) -> Any:
    for home, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"motionary.metrics.{home}"), name)
    if name in _PARTS:
        return import_module(f"motionary.metrics.{name}")
    raise AttributeError(f"module 'motionary.metrics' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, *_PARTS])
