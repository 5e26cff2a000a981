"""Checks shared by the metrics on feature arrays."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from motionary.errors import InputError


def matrix(what: str, values: Any, dimensions: int = 2) -> np.ndarray:
    """`values` (array, list or torch tensor) as a finite float array with so many dimensions.

    Raises:
        InputError: another number of dimensions, no entry, or values that are not finite.
    """
    torch = sys.modules.get("torch")  # who has a tensor has loaded torch; nobody else pays for it
    if torch is not None and isinstance(values, torch.Tensor):
        values = values.detach().cpu().numpy()  # perhaps on another device and with a gradient
    array = np.asarray(values)
    if array.dtype not in (np.float32, np.float64):
        array = array.astype(np.float64)
    if array.ndim != dimensions or array.size == 0:
        raise InputError(what, array.shape, f"must be a non-empty array of {dimensions} dimensions")
    if not np.isfinite(array).all():
        raise InputError(what, f"{int((~np.isfinite(array)).sum())} values", "must be finite")
    return array


def same_shape(what: str, a: np.ndarray, b: np.ndarray) -> None:
    """Raise `InputError` unless both arrays have one shape."""
    if a.shape != b.shape:
        raise InputError(what, f"{a.shape} and {b.shape}", "shapes must be equal")
