"""Where a stage reads and writes: one rule, in one place."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motionary.errors import InputError
from motionary.files import LISTED, atomic_folder, list_files, write_bytes
from motionary.whole import check_list, check_whole, mark_of, writer


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
            raise InputError(relative, "missing", f"run `dvc repro {writer(path)}` first")
        if (path / LISTED).is_file():
            check_whole(path, mark_of(self.home, relative))
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
            check_list(path)
            files = [path / LISTED]
        else:
            files = [path] if path.is_file() else sorted(p for p in path.rglob("*") if p.is_file())
        for file in files:
            digest.update(str(file.relative_to(path.parent)).encode())
            with file.open("rb") as stream:
                for block in iter(lambda: stream.read(1 << 22), b""):
                    digest.update(block)
    return digest.hexdigest()


def values_hash(values: Any) -> str:
    """Hash of plain configuration values, independent of key order."""
    return hashlib.blake2b(json.dumps(values, sort_keys=True, default=str).encode(), digest_size=16).hexdigest()
