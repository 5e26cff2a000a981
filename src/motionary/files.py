"""Where files and folders are read and written: one clear line on a bad path, and nothing half-written."""

from __future__ import annotations

import errno
import glob
import hashlib
import json
import os
import re
import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from motionary.errors import KEPT, InputError

LISTED = "files.json"  # of a folder whose writer lists its files: their sizes and hashes
UNFINISHED = ".unfinished-"  # how the names begin of what is being written; only a killed process leaves it
DISK_REFUSALS = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM}


def readable(path: str | os.PathLike) -> Path:
    """The path of an existing, non-empty file.

    Raises:
        InputError: no such file, a folder, an empty file, or no permission to read.
    """
    path = Path(path)
    if not exists(path):
        raise InputError(path, "missing", "the file does not exist")
    if path.is_dir():
        raise InputError(path, "a folder", "must be a file")
    if not os.access(path, os.R_OK):
        raise InputError(path, "not readable", "permission to read is needed")
    if path.stat().st_size == 0:
        raise InputError(path, "0 bytes", "the file is empty")
    return path


def exists(path: Path) -> bool:
    """Whether a path leads to something; InputError where the system refuses the very name: too long, a circle of
    links."""
    try:
        return path.exists()
    except (OSError, RuntimeError) as error:
        raise InputError(path, getattr(error, "strerror", None) or error, "must be a path that can be opened") from None


def writable(path: str | os.PathLike, force: bool = True) -> Path:
    """The path as a place to write: its folder is made when missing; an existing file stays unless `force`.

    Raises:
        InputError: the file exists and `force` is false, the path is a folder, or its folder cannot be written.
    """
    path = Path(path)
    there = exists(path)
    if path.is_dir():
        raise InputError(path, "a folder", "must be a file name")
    if there and not force:
        raise InputError(path, "exists", KEPT)
    writable_folder(path.parent, path)
    return path


def writable_folder(folder: Path, path: Path | None = None) -> None:
    """Make the folder of a file when it is missing; InputError that names the file, or else the folder, where nothing
    can be written there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(path or folder, error.strerror or error, "the folder cannot be made") from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(path or folder, "not writable", "permission to write in the folder is needed")


@contextmanager
def written_by(stage: str, path: str | os.PathLike) -> Iterator[None]:
    """The block reads `path`, which a stage of the pipeline wrote.

    Raises:
        InputError: whatever the block raises, since such a file is missing or damaged; it names the stage to run.
    """
    try:
        yield
    except Exception as error:
        kind = "" if isinstance(error, InputError) else f"{type(error).__name__}: "
        raise InputError(path, f"{kind}{error}", f"missing or damaged; run `dvc repro {stage}`") from None


@contextmanager
def atomic_file(path: str | os.PathLike, force: bool = True) -> Iterator[Path]:
    """A temporary path beside `path`, with the same extension, that replaces it only if the block succeeds.

    The content is on the disk before it takes the name, so that a power cut leaves the old file or the new one whole.

    Raises:
        InputError: see `writable`; or the disk is full or not writable, in the block too.
    """
    path = writable(path, force)
    temporary = _beside(path)
    with _told(path, temporary):
        # Not tempfile: it makes private files, and the mask of a process can only be asked by changing it.
        try:
            os.close(os.open(temporary, os.O_CREAT | os.O_EXCL, 0o666))
        except OSError as error:  # whatever it says: /proc, say, has no place for a file
            raise InputError(path, error.strerror, "cannot be written") from None
        try:
            yield temporary
            _flush(temporary)
            os.replace(temporary, path)
            _flush(path.parent)
        finally:
            temporary.unlink(missing_ok=True)


@contextmanager
def atomic_folder(path: str | os.PathLike) -> Iterator[Path]:
    """A new folder beside `path` that takes its place, with all it holds, only if the block succeeds.

    No system call replaces a folder that holds files: the old one moves aside first, and comes back if the new one
    cannot take its place. A process killed between these two leaves the old one beside, under `UNFINISHED`.

    Raises:
        InputError: `path` is a file, or the disk is full or not writable, in the block too.
    """
    path = Path(path)
    for place in (path, *path.parents):
        if place.is_file():
            raise InputError(place, "a file", "must be a folder")
    temporary, old = _beside(path), _beside(path)
    with _told(path, temporary):
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.mkdir()
        try:
            yield temporary
            for inner in (*temporary.rglob("*"), temporary):
                _flush(inner)
            _swap(temporary, path, old)
            _flush(path.parent)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


def write_bytes(path: str | os.PathLike, data: bytes | str, force: bool = True) -> Path:
    """Write a whole file atomically; text as UTF-8, in which what has no place, as bytes of a file's name that are no
    UTF-8, is spelled out."""
    with atomic_file(path, force) as temporary:
        temporary.write_bytes(data.encode("utf-8", "backslashreplace") if isinstance(data, str) else data)
    return Path(path)


def save_array(path: str | os.PathLike, array: np.ndarray) -> None:
    """A .npy file, every byte of it by Python's own writing: of `numpy.save`, which hands arrays to C, a full disk may
    take the last block without a word."""
    with open(path, "wb") as file:
        np.lib.format.write_array(_Written(file.write), np.asanyarray(array), allow_pickle=False)


@dataclass(frozen=True)
class _Written:
    """A file of which numpy knows no more than how to write."""

    write: Callable[[bytes], int]


def file_hash(path: Path) -> str:
    """SHA-256 (hex) of a file's content."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def list_files(folder: Path) -> None:
    """Write ``files.json``: bytes and SHA-256 of every file below a folder, by path. The list names the content without
    reading it, and tells which files a disk has damaged since."""
    found = {}
    for path in sorted(path for path in folder.rglob("*") if path.is_file() and path != folder / LISTED):
        found[path.relative_to(folder).as_posix()] = {"bytes": path.stat().st_size, "sha256": file_hash(path)}
    (folder / LISTED).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def read_list(folder: Path) -> dict[str, tuple[int, str]]:
    """What `list_files` wrote: {path: (bytes, SHA-256)}.

    Raises:
        Exception: of any kind, where the list is missing or damaged.
    """
    told = json.loads((folder / LISTED).read_text(encoding="utf-8"))
    return {name: (int(of["bytes"]), str(of["sha256"])) for name, of in told.items()}


def leftovers(path: str | os.PathLike) -> list[Path]:
    """Unfinished files or folders beside `path`, left by killed writers or still being written by running ones."""
    path = Path(path)
    return sorted(path.parent.glob(f"{UNFINISHED}{'?' * 8}-{glob.escape(_short(path))}"))


def _beside(path: Path) -> Path:
    return path.with_name(f"{UNFINISHED}{secrets.token_hex(4)}-{_short(path)}")


def _short(path: Path) -> str:
    return f"{path.stem[:40]}{path.suffix}"


def _swap(new: Path, path: Path, old: Path) -> None:
    if path.exists() or path.is_symlink():
        os.replace(path, old)
        try:
            os.replace(new, path)
        except OSError:
            os.replace(old, path)
            raise
        # A link, as DVC makes them, goes alone: what it points to is not ours.
        old.unlink() if old.is_symlink() else shutil.rmtree(old, ignore_errors=True)
    else:
        os.replace(new, path)


@contextmanager
def _told(path: Path, temporary: Path) -> Iterator[None]:
    """Turns the disk's refusals of `temporary`, and no other errors, into an InputError that names `path`."""
    try:
        yield
    except Exception as error:
        number = getattr(error, "errno", None) or _told_in_words(str(error))
        # A failed write names no file; a failed open names the one it is about, which may be an input of the block.
        named = str(getattr(error, "filename", None) or "")
        ours = not named or named.startswith(str(temporary)) or str(path).startswith(named)
        if number not in DISK_REFUSALS or not ours:
            raise
        raise InputError(path, os.strerror(number), "cannot be written") from None


def _told_in_words(text: str) -> int:
    """The system's number of an error that carries none: safetensors, written in Rust, says it; 0 of any other."""
    return int((re.findall(r"\(os error (\d+)\)", text) or [0])[-1])


def _flush(path: Path) -> None:
    """Have the disk keep a file's content, or a folder's list of names."""
    if path.is_dir() and os.name != "posix":
        return
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
