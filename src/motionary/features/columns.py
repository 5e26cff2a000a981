"""Where a codec keeps what: columns of feature frames by the names of their groups."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from motionary.errors import InputError

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
    """How many columns these are."""
    return chosen.stop - chosen.start if isinstance(chosen, slice) else len(chosen)
