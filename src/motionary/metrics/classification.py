"""How often a classifier names the label that it should."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from motionary.errors import InputError


def accuracy(predicted: Any, labels: Any) -> float:
    """Share of items whose predicted label is the wanted one (thesis 5.3: style or content recognition accuracy).

    Args:
        predicted: (N,) label ids.
        labels: (N,) wanted label ids, N >= 1.
    """
    predicted, labels = _pair(predicted, labels)
    return float((predicted == labels).mean())


def macro_accuracy(predicted: Any, labels: Any, classes: Sequence[int] | None = None) -> float:
    """Mean over classes of each class's own accuracy, so that a frequent class weighs no more than a rare one.

    Args:
        predicted: (N,) label ids.
        labels: (N,) wanted label ids, N >= 1.
        classes: that count; by default every wanted one. Classes that nobody wants are left out.

    Raises:
        InputError: no item wants any of the classes.
    """
    predicted, labels = _pair(predicted, labels)
    present = [c for c in np.unique(labels) if classes is None or c in classes]
    if not present:
        raise InputError("labels", np.unique(labels).tolist(), f"must hold some of the classes {classes}")
    return float(np.mean([(predicted[labels == c] == c).mean() for c in present]))


def _pair(predicted: Any, labels: Any) -> tuple[np.ndarray, np.ndarray]:
    predicted, labels = np.asarray(predicted), np.asarray(labels)
    if predicted.shape != labels.shape or predicted.ndim != 1 or not len(labels):
        raise InputError(
            "predicted, labels", f"{predicted.shape} and {labels.shape}", "must be as many ids, at least 1"
        )
    return predicted, labels
