"""Text as programs wrote it, in whatever encoding."""

from __future__ import annotations

import io
import os
import re
from typing import BinaryIO

from motionary.files import readable


def read_text(path: str | os.PathLike) -> str:
    """The text of a file, decoded by `decoded`."""
    return decoded(readable(path).read_bytes())


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
    own, or UTF-8 where it is in UTF-16. A part that ends with a line can go to `decoded`."""
    file = readable(path).open("rb")
    if _wide(file.read(200)) is None:
        file.seek(0)
        return file
    file.close()
    return io.BytesIO(read_text(path).encode())


def _wide(data: bytes) -> str | None:
    """The name of the UTF-16 that bytes are in, None where they are not."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if not data[:200].strip(b"\0"):
        return None  # zeros alone, as of a hole in a file, are no text
    if (odd := data[1:200:2].count(0)) + (even := data[:200:2].count(0)) > 0.4 * min(len(data), 200):
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
