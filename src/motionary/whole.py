"""Whether the files of a folder are still those that its stage wrote."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path

from motionary.errors import InputError
from motionary.files import LISTED, file_hash, read_list, written_by

# Which stage writes a folder that is read later; anything under models/ is written by its namesake.
_WRITERS = {"corpus": "preprocess", "sources": "source"}


def mark_of(root: Path, relative: str) -> Path:
    """Where the project at `root` remembers which files of its folder `relative` were found whole."""
    return root / ".cache" / "checked" / f"{relative.replace('/', '-')}.json"


def check_output(root: Path, relative: str) -> Path:
    """The folder `relative`, such as "data/corpus", of the project at `root`, held against its list by `check_whole`
    where it has one, for a reader that is no stage.

    Raises:
        InputError: see `check_whole`.
    """
    folder = root / relative
    if (folder / LISTED).is_file():
        check_whole(folder, mark_of(root, relative))
    return folder


def check_whole(folder: Path, mark: Path) -> None:
    """Holds the files of a folder against its list, by their content where it was not done since they were written.

    Args:
        folder: with a ``files.json``.
        mark: a file that remembers sizes and times of what was found whole, so that not everyone need read all of a
            corpus that a stage or a reader before it has read.

    Raises:
        InputError: a file is not what its stage wrote; the line names the file and the stage to run.
    """
    listed = check_list(folder)
    now = {}
    for name, (_, told) in listed.items():
        state = (folder / name).stat()
        now[name] = [told, state.st_size, state.st_mtime_ns]
    try:
        known = dict(json.loads(mark.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        known = {}  # none yet, or cut short: all is read
    if known == now:
        return
    for name, (_, told) in listed.items():
        if known.get(name) != now[name] and file_hash(folder / name) != told:
            raise _damaged(folder / name, "damaged, its SHA-256 differs", f"must be as {LISTED} says", folder)
    with suppress(OSError):  # no room for it: all is read the next time, too
        mark.parent.mkdir(parents=True, exist_ok=True)
        mark.write_text(json.dumps(now), encoding="utf-8")


def check_list(folder: Path) -> dict[str, tuple[int, str]]:
    """The files of a folder against its list, by name and size; returns the list."""
    with written_by(writer(folder), folder / LISTED):
        listed = read_list(folder)
    here = {p.relative_to(folder).as_posix(): p.stat().st_size for p in folder.rglob("*") if p.is_file()}
    here.pop(LISTED)
    sizes = {name: size for name, (size, _) in listed.items()}
    for name in sorted({*sizes, *here}):
        if sizes.get(name) != here.get(name):
            found, told = (f"{known[name]:,} bytes" if name in known else "no such file" for known in (here, sizes))
            raise _damaged(folder / name, found, f"{LISTED} says {told}", folder)
    return listed


def writer(path: Path) -> str:
    """Name of the stage that writes an output."""
    return _WRITERS.get(path.name, path.name)


def _damaged(file: Path, found: str, rule: str, folder: Path) -> InputError:
    return InputError(file, found, f"{rule}; run `dvc repro {writer(folder)}`")
