"""Late imports: names that a package passes on from other modules, and the functions behind methods of `Motion`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

_formats: list[Callable[..., Any]] = []


def hand_on(package: str, homes: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """The ``__getattr__`` and ``__dir__`` of a package.

    Args:
        package: its name.
        homes: full name of the module that holds each name; a name that is its own home's last part is that module.
    """

    def get(name: str) -> Any:
        """The value of a name that is handed on."""
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module = import_module(homes[name])
        return getattr(module, name, module)

    return get, lambda: sorted(homes)


def save_with(save: Callable[..., None], to: Callable[..., Any], plant: Callable[..., Any]) -> None:
    """Sets the functions that ``Motion.save``, ``Motion.to`` and ``Motion.plant_feet`` call. The package does so before
    any of its modules is imported: these functions need the motion's module, which must not import them in turn."""
    _formats[:] = [save, to, plant]


def save(motion: Any, path: Any, **options: Any) -> None:
    """Writes a motion with what was handed in."""
    _formats[0](motion, path, **options)


def to(motion: Any, rig: Any) -> Any:
    """Puts a motion onto a rig, or a file's rig, with what was handed in."""
    return _formats[1](motion, rig)


def plant(motion: Any, first_frame: int) -> Any:
    """Lets the feet of a motion stand with what was handed in."""
    return _formats[2](motion, first_frame)
