"""Where a codec keeps what: columns of feature frames by the names of their groups."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from motionary.errors import InputError
from motionary.motion import Motion, Skeleton

# Indices of columns, a slice where they follow each other: indexing by it then makes a view and no copy.
Columns = slice | list[int]


def columns(slices: Mapping[str, slice], names: Sequence[str]) -> Columns:
    """Columns of the named groups, one group after the other in the order of the names.

    Raises:
        InputError: no such group.
    """
    found: list[int] = []
    for name in names:
        if name not in slices:
            raise InputError("features", name, f"must be one of the codec's groups, {', '.join(slices)}")
        found += range(slices[name].start, slices[name].stop)
    return packed(found)


def other_columns(slices: Mapping[str, slice], names: Sequence[str]) -> Columns:
    """All columns but those of the named groups, in their own order; a group that is not there leaves none out."""
    kept = [range(part.start, part.stop) for name, part in slices.items() if name not in names]
    return packed(sorted(index for part in kept for index in part))


def packed(indices: Sequence[int]) -> Columns:
    """Indices as :data:`Columns`."""
    first = indices[0] if len(indices) else 0
    follow = list(indices) == list(range(first, first + len(indices)))
    return slice(first, first + len(indices)) if follow else list(indices)


def width(chosen: Columns) -> int:
    """The number of columns."""
    return chosen.stop - chosen.start if isinstance(chosen, slice) else len(chosen)


def tiled(widths: Mapping[str, int]) -> dict[str, slice]:
    """Columns of groups that follow each other, by the number of columns of each."""
    ends = np.cumsum(list(widths.values())).tolist()
    return {name: slice(end - width, end) for (name, width), end in zip(widths.items(), ends, strict=True)}


def check_joints(motion: Motion, skeleton: Skeleton) -> None:
    """InputError unless the motion has the joints of a codec's skeleton."""
    if motion.skeleton.joints != skeleton.joints:
        raise InputError("motion", motion.skeleton.name, f"needs the joints of {skeleton.name}; retarget it first")


def check_features(features: np.ndarray, dim: int) -> np.ndarray:
    """Features (T, dim) as float64; InputError for another shape or values that are not finite."""
    features = np.asarray(features)
    if features.ndim != 2 or features.shape[1] != dim or len(features) < 1:
        raise InputError("features", features.shape, f"shape (T, {dim}) with T >= 1")
    if not np.isfinite(features).all():
        raise InputError("features", "NaN or infinity", "values must be finite")
    return features.astype(np.float64)
