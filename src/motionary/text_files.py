"""Text as programs wrote it, in whatever encoding."""

from __future__ import annotations

import io
import os
import re
from typing import BinaryIO

from motionary.errors import InputError
from motionary.files import readable

_LONGEST = 1 << 22  # bytes of a file that is small by its kind: a skeleton, a mapping
_LONGEST_WIDE = 1 << 27  # bytes of a text in UTF-16, which takes four times as many while it is turned into UTF-8


def read_text(path: str | os.PathLike, most: int = _LONGEST, kind: str = "such a text") -> str:
    """The text of a file of at most `most` bytes, decoded by `decoded`; `kind` names such files in errors.

    Raises:
        InputError: it cannot be read, or is longer.
    """
    path = readable(path)
    if (size := path.stat().st_size) > most:
        raise InputError(path, f"{size:,} bytes", f"{kind} may have {most:,} (is it damaged?)")
    return decoded(path.read_bytes())


def decoded(data: bytes) -> str:
    """The text of bytes: UTF-8 or UTF-16, with or without a byte order mark, else what old exporters wrote: Shift-JIS
    where it reads as Japanese words, or Latin-1."""
    if (wide := _wide(data)) is not None:
        return data.decode(wide, errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return _japanese(data) or data.decode("latin-1")


def text_stream(path: str | os.PathLike) -> BinaryIO:
    """A text file opened for reading a piece at a time, as bytes in which digits and spaces are ASCII's: the file's
    own, or UTF-8 where it is in UTF-16. A part that ends with a line can go to `decoded`.

    Raises:
        InputError: it cannot be read, or is in UTF-16 and longer than 128 MB.
    """
    file = readable(path).open("rb")
    if _wide(file.read(200)) is None:
        file.seek(0)
        return file
    file.close()
    return io.BytesIO(read_text(path, _LONGEST_WIDE, "a text in UTF-16").encode())


def _wide(data: bytes) -> str | None:
    """The name of the UTF-16 that bytes are in, None where they are not."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    known = len(data[:200].rstrip(b"\0"))  # zeros at the end, as of a hole in a file, are no text
    head = data[: known + known % 2]
    if (odd := head[1::2].count(0)) + (even := head[::2].count(0)) > 0.4 * len(head):
        return "utf-16-le" if odd > even else "utf-16-be"
    return None


def _japanese(data: bytes) -> str | None:
    """The text in Shift-JIS, None where it is not: an accented letter of Latin-1 may pass for a character, no word."""
    try:
        text = data.decode("cp932")
    except UnicodeDecodeError:
        return None
    wide = sum(1 for character in text if ord(character) > 0x2FFF)
    runs = re.findall(r"[\u3000-\u9fff\uff00-\uffef]{2,}", text)
    return text if sum(map(len, runs)) > 0.5 * wide > 0 else None
