"""Means of the physical measures over motions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from motionary.evaluation.items import Items
from motionary.metrics.physics import physics
from motionary.motion import Motion

DIGITS = 6  # bones change by millimetres


def plausibility(items: Items, features: Sequence[np.ndarray]) -> dict[str, float]:
    """Mean of every measure of :func:`motionary.metrics.physics.physics`, and of the length in seconds, over the
    motions of raw features, each (T, D)."""
    return mean_physics(items.motions(features))


def mean_physics(motions: Sequence[Motion]) -> dict[str, float]:
    """`plausibility` of motions themselves."""
    rows = [{**physics(motion), "seconds": motion.duration} for motion in motions]
    return {name: round(float(np.mean([row[name] for row in rows])), DIGITS) for name in rows[0]}
