"""The files that an index leaves beside the motions, and which of those that are there it may replace."""

from __future__ import annotations

import os
from pathlib import Path

from motionary.archive.stored_index import HIDDEN, INDEX, read_told
from motionary.errors import KEPT, InputError
from motionary.files import file_hash, writable

CAPTIONS, FLAGS, DUPLICATES = "captions.jsonl", "flags.jsonl", "duplicates.jsonl"
WROTE = "wrote"  # key of index.json: the hashes of each result, as it is and as it was before


def claim(out: Path, force: bool) -> dict[str, str]:
    """The results in `out` that an earlier index wrote as they are now: their hashes by name.

    Raises:
        InputError: another file is called as a result and `force` is false, or something that is no file is.
    """
    own: dict[str, str] = {}
    wrote = _wrote(out / HIDDEN / INDEX)
    for name in (CAPTIONS, FLAGS, DUPLICATES):
        path = out / name
        if not os.path.lexists(path):  # a link that leads nowhere is somebody's too
            continue
        writable(path)
        digest = file_hash(path) if wrote != {} and path.is_file() and os.access(path, os.R_OK) else ""
        if digest and (wrote is None or digest in wrote.get(name, ())):
            own[name] = digest
        elif not force:
            raise InputError(path, "exists, not as an index wrote it", KEPT)
    return own


def _wrote(place: Path) -> dict[str, list[str]] | None:
    """The hashes that an index notes of its results; None of one by a version that noted none."""
    try:
        told = read_told(place)
    except InputError:  # no index, or one that tells nothing
        return {}
    if WROTE not in told:
        return None
    noted = told[WROTE] if isinstance(told[WROTE], dict) else {}
    return {name: own for name, own in noted.items() if isinstance(own, list)}
