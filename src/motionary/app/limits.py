"""What one visitor may ask for. The page's controls show these limits; the server holds them, whatever is sent."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from motionary.errors import InputError

MOST_BYTES = 20 * 2**20  # of an upload, and of all that a visitor has not finished sending
MOST_UNFINISHED = 2  # uploads at a time; the page has two buttons
MOST_PARTS = 1024  # of an upload; the page sends 40 for the largest
MOST_UNPACKED = 200 * 2**20  # of an npz
MOST_SECONDS = 300.0  # of an uploaded motion
MOST_PLACES = 1_500_000  # frames x joints of an uploaded motion: two seconds of work and 80 MB where it is shown
MOST_VIDEO = 60.0  # seconds of a motion that a video shows
MOST_VARIANTS = 6
MOST_GENERATED = 9.8  # seconds
MOST_FOLLOWING = 5  # sentences that a motion goes on with
MOST_LETTERS = 1000  # of a path
MOST_DRAWS = 40  # captions that are drawn for a consensus
FEET = "off: as the models made them"
MOST_STRENGTH = 1.5  # of a style
LARGEST_SEED = 2**31 - 1
SPEEDS = (0.1, 2.0)  # of playback


def within(name: str, value: Any, low: float, high: float) -> Any:
    """The value; InputError unless it is a number from `low` to `high`."""
    if not isinstance(value, int | float) or not low <= value <= high:  # nan is not within either
        raise InputError(name, value, f"must be a number from {low:g} to {high:g}")
    return value


def among(name: str, value: Any, known: Collection[str]) -> str:
    """The value; InputError unless it is one of those known."""
    if not isinstance(value, str) or value not in known:
        raise InputError(name, value, f"must be one of {', '.join(known)}")
    return value
