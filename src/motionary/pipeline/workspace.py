"""Where a stage reads and writes: one rule, in one place."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motionary.errors import InputError
from motionary.files import LISTED, atomic_folder, file_hash, list_files, read_list, write_bytes, written_by

# Which stage writes a folder that another stage reads; anything under models/ is written by its namesake.
_WRITERS = {"corpus": "preprocess", "sources": "source"}


@dataclass(frozen=True)
class Workspace:
    """The folders of one stage run.

    Attributes:
        root: the project (or DVC's temporary copy of it): inputs are read from here.
        home: the real project, where caches and the tracking database live, also for queued experiments.
        target: outputs go below this folder: `root` when DVC runs the stage, otherwise Hydra's run folder.
    """

    root: Path
    home: Path
    target: Path

    @classmethod
    def find(cls, root: Path, run_folder: Path | None) -> Workspace:
        """The workspace of the stage file below `root`; DVC announces itself by ``DVC_STAGE``."""
        home = Path(os.environ.get("DVC_ROOT") or root).resolve()
        if os.environ.get("DVC_STAGE"):
            return cls(root, home, root)
        if run_folder is None:
            raise InputError("run folder", run_folder, "outside DVC a stage needs Hydra's run folder")
        return cls(root, home, run_folder.resolve())

    def input(self, relative: str) -> Path:
        """An upstream output; absent or damaged, the error names the stage to run."""
        path = self.root / relative
        if not path.exists():
            raise InputError(relative, "missing", f"run `dvc repro {_writer(path)}` first")
        if (path / LISTED).is_file():
            check_whole(path, self.home / ".cache" / "checked" / f"{relative.replace('/', '-')}.json")
        return path

    @contextmanager
    def publish(self, relative: str) -> Iterator[Path]:
        """A temporary folder that becomes the output `relative`, with a list of its files, when the block ends without
        an error."""
        with atomic_folder(self.target / relative) as folder:
            yield folder
            list_files(folder)

    def write_json(self, relative: str, values: Mapping[str, Any]) -> Path:
        """Writes `values` to the output file `relative`, atomically."""
        return write_bytes(self.target / relative, json.dumps(values, indent=1, allow_nan=False) + "\n")


def content_hash(*paths: Path) -> str:
    """Hash of files and of all files below folders: names and contents.

    A folder with a ``files.json`` (see :func:`motionary.files.list_files`) is named by that list and not read,
    as every stage, and every process of it, would do with the whole corpus.

    Raises:
        InputError: the files of such a folder are not those that its list says, or of another size.
    """
    digest = hashlib.blake2b(digest_size=16)
    for path in paths:
        if (path / LISTED).is_file():
            _check_list(path)
            files = [path / LISTED]
        else:
            files = [path] if path.is_file() else sorted(p for p in path.rglob("*") if p.is_file())
        for file in files:
            digest.update(str(file.relative_to(path.parent)).encode())
            with file.open("rb") as stream:
                for block in iter(lambda: stream.read(1 << 22), b""):
                    digest.update(block)
    return digest.hexdigest()


def check_whole(folder: Path, mark: Path) -> None:
    """Holds the files of a folder against its list, by their content where it was not done since they were written.

    Args:
        folder: with a ``files.json``.
        mark: a file that remembers sizes and times of what was found whole, so that a stage need not read all of a
            corpus that a stage before it has read.

    Raises:
        InputError: a file is not what its stage wrote; the line names the file and the stage to run.
    """
    listed = _check_list(folder)
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


def _check_list(folder: Path) -> dict[str, tuple[int, str]]:
    """The files of a folder against its list, by name and size; returns the list."""
    with written_by(_writer(folder), folder / LISTED):
        listed = read_list(folder)
    here = {p.relative_to(folder).as_posix(): p.stat().st_size for p in folder.rglob("*") if p.is_file()}
    here.pop(LISTED)
    sizes = {name: size for name, (size, _) in listed.items()}
    for name in sorted({*sizes, *here}):
        if sizes.get(name) != here.get(name):
            found, told = (f"{known[name]:,} bytes" if name in known else "no such file" for known in (here, sizes))
            raise _damaged(folder / name, found, f"{LISTED} says {told}", folder)
    return listed


def _damaged(file: Path, found: str, rule: str, folder: Path) -> InputError:
    return InputError(file, found, f"{rule}; run `dvc repro {_writer(folder)}`")


def _writer(path: Path) -> str:
    """Name of the stage that writes an upstream output."""
    return _WRITERS.get(path.name, path.name)


def values_hash(values: Any) -> str:
    """Hash of plain configuration values, independent of key order."""
    return hashlib.blake2b(json.dumps(values, sort_keys=True, default=str).encode(), digest_size=16).hexdigest()
