"""The numbers of a long text, read a piece at a time: memory for a piece, however long the file is."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np

from motionary.errors import InputError

PIECE = 1 << 21  # bytes
LONGEST_LINE = 1 << 24  # bytes; a longer one is a hole in a file
SLOW = 1.0  # s after which a bar is shown
_ENDS = b" \t\r\n\x00\x1a"  # what may stand after the last number: DOS marks the end of a text with 0x1A
_MOST_FILLING = 1 << 26  # bytes after the last number
_SPACES = (b"\n", b"\r", b" ", b"\t")

Told = Callable[[int], object]  # is told of bytes that were read


@contextmanager
def reading_bar(file: BinaryIO, path: str | os.PathLike, shown: bool | None) -> Iterator[Told]:
    """A bar of the bytes read, with their speed, where `shown` and if it takes longer than a second.

    Args:
        file: what is read.
        path: its name, for people.
        shown: whether there is a bar at all.

    Yields:
        What is to be told of each number of bytes that were read.
    """
    if not shown:
        yield lambda count: None
        return
    from tqdm import tqdm

    size = file.seek(0, 2)
    with tqdm(desc=Path(path).name, total=size, unit="B", unit_scale=True, delay=SLOW) as bar:
        yield bar.update


def text_end(file: BinaryIO, name: object) -> int:
    """Bytes up to the last that is neither white space nor filling.

    Raises:
        InputError: there is more of these than any program writes, as in a file with a hole of gigabytes.
    """
    at = size = file.seek(0, 2)
    while at > 0:
        if size - at > _MOST_FILLING:
            raise InputError(name, f"{_MOST_FILLING:,} bytes of filling", "must end with its text (is it damaged?)")
        start = max(at - PIECE, 0)
        file.seek(start)
        if tail := file.read(at - start).rstrip(_ENDS):
            return start + len(tail)
        at = start
    return 0


def text_lines(file: BinaryIO, end: int) -> Iterator[bytes]:
    """The lines from where the file stands up to byte `end`, with their ends; of a line that is longer than
    `LONGEST_LINE` the beginning alone, as soon as it is longer than that."""
    rest, given = b"", False  # of a line that goes on; whether its beginning was given
    while piece := file.read(min(PIECE, end - file.tell())):
        *lines, rest = (rest + piece).splitlines(keepends=True)  # a piece may end between \r and \n
        yield from lines[1:] if given else lines
        given = given and not lines
        if not given and len(rest) > LONGEST_LINE:
            yield rest
            given = True
        if given:
            rest = rest[-1:]
    if rest and not given:
        yield rest


def number_rows(file: BinaryIO, end: int, width: int, told: Told) -> Iterator[np.ndarray]:
    """The numbers from where the file stands up to byte `end`, as rows (n, width) float64, piece by piece.

    Raises:
        ValueError: what stands there is no number, not finite, or ends in the middle of a row.
    """
    rest, left = b"", np.empty(0)
    while piece := file.read(min(PIECE, end - file.tell())):
        told(len(piece))
        text = rest + piece
        cut = len(text) if file.tell() >= end else next((c for s in _SPACES if (c := text.rfind(s)) > 0), -1)
        if cut < 0:
            raise ValueError("no space")
        values, rest = np.concatenate([left, numbers_of(text[:cut])]), text[cut:]
        if not np.isfinite(values).all():
            raise ValueError("not finite")
        whole = values.size // width * width
        if whole:
            yield values[:whole].reshape(-1, width)
        left = values[whole:]
    if left.size:
        raise ValueError("a row is cut")


def numbers_of(text: bytes) -> np.ndarray:
    """The numbers (n,) float64 of a text, with white space between them; commas where there are no points are points.

    Raises:
        ValueError: what stands there is no number.
    """
    if not text or text.isspace():
        return np.empty(0)  # numpy finds a number there
    with warnings.catch_warnings():
        # numpy warns (or, later, raises) where text is not a number.
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text, sep=" ")
        except (DeprecationWarning, ValueError) as error:
            if (pointed := with_points(text.decode("latin-1")).encode("latin-1")) != text:
                return numbers_of(pointed)
            raise ValueError(error) from None


def with_points(text: str) -> str:
    """Numbers as programs in many a language write them, with points for commas; a text that has points is left."""
    return text if "." in text else text.replace(",", ".")
