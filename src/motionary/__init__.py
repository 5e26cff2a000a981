"""motionary: a two-way dictionary between human motion and language.

Names are handed on lazily, so that importing one part of the package loads only that part.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from motionary.dictionary import load
    from motionary.errors import InputError
    from motionary.formats import read_motion
    from motionary.motion import Motion, Skeleton

__version__ = "0.1.0"

_HOMES = {
    "InputError": "motionary.errors",
    "Motion": "motionary.motion",
    "Skeleton": "motionary.motion",
    "read_motion": "motionary.formats",
    "load": "motionary.dictionary",
}
_PARTS = ("corpus", "evaluation", "features", "formats", "language", "metrics", "models", "motion", "training")

__all__ = ["InputError", "Motion", "Skeleton", "__version__", "load", "read_motion"]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    if name in _PARTS:
        return import_module(f"motionary.{name}")
    raise AttributeError(f"module 'motionary' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, *_PARTS])
