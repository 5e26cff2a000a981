"""Arrays out of .npy and .npz files that anyone may have written: nothing is unpickled, and no size is believed.

A header is read first and compared with the bytes that are there; only then is memory taken. Of what a zip file can
be, numpy's own kind is read: members that are stored or deflated, and not encrypted.
"""

from __future__ import annotations

import math
import warnings
import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import IO, Any

import numpy as np

from motionary.errors import InputError
from motionary.formats.read.extent import check_extent

NUMBERS, TEXT = "fiu", "U"
_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_LONGEST_TEXT = 4_000_000  # bytes of a text array, four for each character
_MOST_MEMBERS = 1000
_CHUNK = 1 << 20
_DAMAGED = "not a readable numpy file (damaged or truncated?)"


def read_npy(path: Path, kinds: str = NUMBERS) -> np.ndarray:
    """The array of a .npy file.

    Args:
        path: an existing file.
        kinds: which kinds of dtype are taken (numpy's letters).

    Raises:
        InputError: damaged, truncated, another kind of values, or more than a motion of this file's size holds.
    """
    with open(path, "rb") as file:
        size = path.stat().st_size
        shape, fortran, dtype = _header(file, path, kinds, size)
        count = math.prod(shape)
        if count * dtype.itemsize > size - file.tell():
            raise _short(path, shape, dtype)
        return _shaped(np.fromfile(file, dtype, count), shape, fortran)


def npy_shape(path: Path) -> tuple[int, ...]:
    """The shape of a .npy file's array of numbers, from its header alone; errors as `read_npy`."""
    with open(path, "rb") as file:
        return _header(file, path, NUMBERS, path.stat().st_size)[0]


class ArrayArchive:
    """An .npz file, open for reading; use as a context.

    Attributes:
        names: of its arrays.

    Raises:
        InputError: not a zip file that can be read.
    """

    def __init__(self, path: Path):
        self.path = path
        try:
            self._zip = zipfile.ZipFile(path)
        # The zip format has more corners than zipfile has exceptions of its own.
        except Exception as error:
            raise damaged(path, error) from None
        entries = self._zip.infolist()
        if len(entries) > _MOST_MEMBERS:
            self._zip.close()
            raise InputError(path, f"{len(entries)} arrays", f"must hold at most {_MOST_MEMBERS}")
        self._entries = {entry.filename.removesuffix(".npy"): entry for entry in entries}
        self.names = tuple(self._entries)

    def __enter__(self) -> ArrayArchive:
        return self

    def __exit__(self, *_: object) -> None:
        self._zip.close()

    def read(self, name: str, kinds: str = NUMBERS) -> np.ndarray:
        """An array by its name; errors as `read_npy`, and for what numpy would not have written."""
        entry, what = self._entries[name], f"{self.path}, {name}"
        if entry.flag_bits & 0x1:
            raise InputError(what, "encrypted", "must be saved without a password")
        if entry.compress_type not in _METHODS:
            raise InputError(what, f"compression {entry.compress_type}", "must be stored or deflated, as numpy does")
        try:
            with self._zip.open(entry) as file:
                shape, fortran, dtype = _header(file, what, kinds, self.path.stat().st_size)
                wanted = math.prod(shape) * dtype.itemsize
                if wanted > entry.file_size - file.tell():
                    raise _short(what, shape, dtype)
                return _shaped(np.frombuffer(_bytes(file, wanted), dtype), shape, fortran)
        except InputError:
            raise
        except Exception as error:
            raise damaged(what, error) from None


def damaged(what: object, error: Exception) -> InputError:
    """The complaint about a file that numpy or zipfile cannot read, for the reason that they give."""
    return InputError(what, f"{type(error).__name__}: {error}" if str(error) else type(error).__name__, _DAMAGED)


def _header(file: IO[bytes], what: object, kinds: str, size: int) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, order and dtype; the header is Python's own text, which can be wrong in as many ways as Python can."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of headers that Python 2 wrote
            shape, fortran, dtype = _HEADERS[np.lib.format.read_magic(file)](file)
    except Exception as error:
        raise damaged(what, error) from None
    if dtype.hasobject:
        raise InputError(what, "pickled objects", "never loaded: save plain arrays")
    if dtype.kind not in kinds or dtype.itemsize == 0:
        rule = "must be real numbers" if kinds == NUMBERS else f"must be of kind {' or '.join(kinds)}"
        raise InputError(what, f"{dtype} {shape}", rule)
    if any(length < 0 for length in shape):
        raise InputError(what, shape, "no length of an array can be below 0")
    if dtype.kind == "U" and math.prod(shape) * dtype.itemsize > _LONGEST_TEXT:
        raise InputError(what, f"{dtype} {shape}", f"text may take at most {_LONGEST_TEXT:,} bytes")
    per_joint = 4 if shape and shape[-1] == 4 else 3  # a rotation, or a place
    check_extent(what, f"{dtype} {shape}", math.prod(shape) // per_joint, size)
    return shape, bool(fortran), dtype


def _bytes(file: IO[bytes], wanted: int) -> bytearray:
    """That many bytes, taken as they are unpacked: what a member declares is no reason to allocate."""
    found = bytearray()
    while len(found) < wanted and (chunk := file.read(min(_CHUNK, wanted - len(found)))):
        found += chunk
    if len(found) < wanted:
        raise EOFError(f"{len(found):,} of {wanted:,} bytes")
    file.read(1)  # at its end zipfile compares the checksum
    return found


def _shaped(values: np.ndarray, shape: Iterable[int], fortran: bool) -> np.ndarray:
    shape = tuple(shape)
    return values.reshape(shape[::-1]).T if fortran else values.reshape(shape)


def _short(what: object, shape: tuple[int, ...], dtype: np.dtype[Any]) -> InputError:
    return InputError(what, f"{dtype} {shape}", "is more than the file holds (damaged or truncated?)")
