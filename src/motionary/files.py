"""Where files are opened and written: one clear line on a bad path, and never a half-written file."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from motionary.errors import InputError


def readable(path: str | os.PathLike) -> Path:
    """The path of an existing, non-empty file.

    Raises:
        InputError: no such file, a folder, an empty file, or no permission to read.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(path, "missing", "the file does not exist")
    if path.is_dir():
        raise InputError(path, "a folder", "must be a file")
    if not os.access(path, os.R_OK):
        raise InputError(path, "not readable", "permission to read is needed")
    if path.stat().st_size == 0:
        raise InputError(path, "0 bytes", "the file is empty")
    return path


def read_text(path: str | os.PathLike) -> str:
    """The text of a file; bytes that are not UTF-8 (old exporters write local code pages) are kept as Latin-1."""
    data = readable(path).read_bytes()
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def writable(path: str | os.PathLike, force: bool = True) -> Path:
    """The path as a place to write: its folder is made when missing; an existing file stays unless `force`.

    Raises:
        InputError: the file exists and `force` is false, the path is a folder, or its folder cannot be written.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(path, "a folder", "must be a file name")
    if path.exists() and not force:
        raise InputError(path, "exists", "kept as it is; use force=True (--force) to replace it")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(path, error.strerror or error, "its folder cannot be made") from None
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise InputError(path, "not writable", "permission to write in its folder is needed")
    return path


@contextmanager
def atomic(path: str | os.PathLike, force: bool = True) -> Iterator[Path]:
    """A temporary path beside `path`, with the same extension, that replaces it only if the block succeeds.

    Raises:
        InputError: see `writable`.
    """
    path = writable(path, force)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.stem[:40]}.", suffix=path.suffix, dir=path.parent)
    except OSError as error:
        raise InputError(path, error.strerror or error, "cannot be written") from None
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp makes files private; give the result the permissions that a plain open() would have given.
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_bytes(path: str | os.PathLike, data: bytes | str, force: bool = True) -> Path:
    """Write a whole file atomically."""
    with atomic(path, force) as temporary:
        temporary.write_bytes(data.encode("utf-8") if isinstance(data, str) else data)
    return Path(path)
