"""What a motion file may hold: small files that unpack to gigabytes are refused before anything is allocated."""

from __future__ import annotations

from motionary.errors import InputError

SMALL = 1_000_000  # joints x frames that any file may hold: 38 minutes of 22 joints at 20 fps
_BYTES = 2  # of a larger file, per joint and frame: even well packed, real motion takes more
_MOST = 50_000_000
FARTHEST = 1e12  # units of a file; beyond it products overflow, and no unit makes a place of it


def check_extent(what: object, shown: object, points: int, size: int) -> None:
    """InputError where a file of `size` bytes claims more points (joints x frames) than a motion of its size can have;
    `shown` is what it claims, in its own words."""
    most = min(max(SMALL, size // _BYTES), _MOST)
    if points > most:
        rule = f"a motion in a file of {size:,} bytes may have {most:,} joints x frames; cut it into parts"
        raise InputError(what, shown, rule)
