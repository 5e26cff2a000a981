"""Motion files: readers, writers and pictures, each loaded only when a file asks for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from motionary.lazy import hand_on

if TYPE_CHECKING:
    from motionary.formats.read import READERS, read_motion
    from motionary.formats.write import WRITERS, write_motion

__all__ = ["READERS", "WRITERS", "read_motion", "write_motion"]

# What only draws motion does not load the tables of readers and writers, and does not hang on them.
_HOMES = {
    "READERS": "motionary.formats.read",
    "read_motion": "motionary.formats.read",
    "WRITERS": "motionary.formats.write",
    "write_motion": "motionary.formats.write",
}
__getattr__, __dir__ = hand_on(__name__, _HOMES)
