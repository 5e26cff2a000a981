"""What taking stock of a data root says of each of its files."""

from __future__ import annotations

import hashlib
import json
import math
import re
import time
from pathlib import Path
from typing import Any

from motionary.corpus.checks import check_home, check_unicode
from motionary.errors import InputError
from motionary.files import write_bytes
from motionary.formats.bvh_text import head_of
from motionary.formats.read.numpy_files import npy_shape
from motionary.text_files import decoded, text_stream

_COARSE = 2 * 10**9  # ns


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


class Stock:
    """What was found out of each file of a root, kept beside the project: a file that is as it was is not read again.

    A file counts as unchanged while its size and times of change stay the same. One that changed less than two seconds
    before it was read is read again, since file times may be that coarse.

    Args:
        path: where the stock of the last time is kept; None keeps none. What cannot be read of it counts as empty.
    """

    def __init__(self, path: Path | None = None):
        self.path = path
        self._now: dict[str, list[Any]] = {}
        try:
            values = {} if path is None else json.loads(path.read_bytes())
            self._before: dict[str, list[Any]] = values if isinstance(values, dict) else {}
        except (OSError, ValueError, RecursionError):
            self._before = {}

    def describe(self, path: Path, root: Path, fps: float | None) -> dict[str, Any]:
        """Path in the root, hash, bytes, and seconds where the header tells them."""
        name, begun, state = path.relative_to(root).as_posix(), time.time_ns(), path.stat()
        key = [state.st_size, state.st_mtime_ns, state.st_ctime_ns, fps]
        known = self._before.get(name)
        if isinstance(known, list) and len(known) == 6 and known[:4] == key:
            digest, seconds = known[4:]
        else:
            with path.open("rb") as file:
                digest = hashlib.file_digest(file, "sha256").hexdigest()
            seconds = _seconds(path, fps)
        if max(state.st_mtime_ns, state.st_ctime_ns) < begun - _COARSE:
            self._now[name] = [*key, digest, seconds]
        return {"path": name, "sha256": digest, "bytes": state.st_size, "seconds": seconds}

    def keep(self) -> None:
        """Keep what was described this time for the next."""
        if self.path is not None and self._now != self._before:
            write_bytes(self.path, json.dumps(self._now))


def _seconds(path: Path, fps: float | None) -> float | None:
    """Duration from the header of a .npy or .bvh file."""
    try:
        if path.suffix.lower() == ".npy" and fps:
            return round(npy_shape(path)[0] / fps, 4)
        if path.suffix.lower() == ".bvh":
            with text_stream(path) as file:
                text = decoded(head_of(file, file.seek(0, 2)))
            frames = re.search(r"Frames:\s*(\d+)\s+Frame Time:\s*([\d.eE+-]+)", text)
            seconds = int(frames[1]) * float(frames[2]) if frames else math.inf
            return round(seconds, 4) if math.isfinite(seconds) else None
    except (OSError, ValueError, TypeError, OverflowError, IndexError):
        return None  # preprocess names what is wrong with it
    return None
