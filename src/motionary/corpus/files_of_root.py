"""What taking stock of a data root says of each of its files."""

from __future__ import annotations

import hashlib
import math
import re
from pathlib import Path
from typing import Any

from motionary.corpus.checks import check_home, check_unicode
from motionary.errors import InputError
from motionary.files import read_text
from motionary.formats.read.numpy_files import npy_shape


def belongs(root: Path, path: Path, strictly: bool) -> bool:
    """Whether a file belongs to the folder (`strictly`: no link leads out of it).

    What does not is listed among the problems, where it is a motion.
    """
    try:
        check_unicode(str(path), path)
        if strictly:
            check_home(root, path, path)
    except InputError:
        return False
    return True


def describe(path: Path, root: Path, fps: float | None) -> dict[str, Any]:
    """Path in the root, hash, bytes, and seconds where the header tells them."""
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return {
        "path": path.relative_to(root).as_posix(),
        "sha256": digest,
        "bytes": path.stat().st_size,
        "seconds": _seconds(path, fps),
    }


def _seconds(path: Path, fps: float | None) -> float | None:
    """Duration from the header of a .npy or .bvh file."""
    try:
        if path.suffix.lower() == ".npy" and fps:
            return round(npy_shape(path)[0] / fps, 4)
        if path.suffix.lower() == ".bvh":
            text = read_text(path)
            frames = re.search(r"Frames:\s*(\d+)\s+Frame Time:\s*([\d.eE+-]+)", text)
            seconds = int(frames[1]) * float(frames[2]) if frames else math.inf
            return round(seconds, 4) if math.isfinite(seconds) else None
    except (OSError, ValueError, TypeError, OverflowError, IndexError):
        return None  # preprocess names what is wrong with it
    return None
