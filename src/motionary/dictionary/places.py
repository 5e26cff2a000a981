"""Where the models lie that answer when none are named."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from motionary.errors import InputError
from motionary.systems.registry import known

VARIABLE = "MOTIONARY_MODELS"
PACKAGED = Path(__file__).parents[1] / "pretrained" / "bundle"
_TOLD: set[Path] = set()


def usual_models() -> Path:
    """The folder that $MOTIONARY_MODELS names, else ``models`` where trained systems lie in it, else what is installed
    with the package. Which it is stands once on standard error.

    Raises:
        InputError: the variable names no folder, or there is none of the three.
    """
    if named := os.environ.get(VARIABLE):
        if not Path(named).is_dir():
            raise InputError(VARIABLE, named, "must name a folder of trained models")
        return _told(Path(named), f"${VARIABLE}")
    for folder, kind in ((Path("models"), "in this folder"), (PACKAGED, "packaged")):
        if holds_systems(folder):
            return _told(folder, kind)
    rule = f"none here, none packaged; name a folder (--models, ${VARIABLE}) or run `dvc repro` first"
    raise InputError("models", "missing", rule)


def holds_systems(folder: Path) -> bool:
    """Whether any known system lies in a folder."""
    return any((folder / name).is_dir() for name in known())


def _told(folder: Path, kind: str) -> Path:
    if folder.resolve() not in _TOLD:
        _TOLD.add(folder.resolve())
        print(f"models: {folder} ({kind})", file=sys.stderr)
    return folder
