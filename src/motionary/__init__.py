"""motionary: a two-way dictionary between human motion and language.

Everything loads when it is first asked for.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from motionary.errors import InputError
from motionary.lazy import hand_on, save_with

if TYPE_CHECKING:
    from motionary.dictionary import load
    from motionary.formats import read_motion
    from motionary.motion import Motion, Skeleton

__version__ = "0.1.0"
__all__ = ["InputError", "Motion", "Skeleton", "__version__", "load", "read_motion"]

_PARTS = (
    "corpus", "dictionary", "evaluation", "features", "formats", "language", "metrics", "motion", "systems", "training",
)  # fmt: skip
_HOMES = {
    "Motion": "motionary.motion",
    "Skeleton": "motionary.motion",
    "load": "motionary.dictionary",
    "read_motion": "motionary.formats",
}
__getattr__, __dir__ = hand_on(__name__, _HOMES | {part: f"motionary.{part}" for part in _PARTS})


def _save(motion: Motion, path: Path | str, **options: Any) -> None:
    from motionary.formats import write_motion

    write_motion(motion, path, **options)


def _to(motion: Motion, rig: Skeleton | Motion | Path | str) -> Motion:
    from motionary.formats.rig_files import read_rig
    from motionary.motion.rigging import to_rig

    return to_rig(motion, read_rig(rig))


def _plant(motion: Motion, first_frame: int) -> Motion:
    from motionary.motion.planting import plant_feet

    return plant_feet(motion, first_frame)


save_with(_save, _to, _plant)  # motion itself knows no file format, and nothing that stands on it
