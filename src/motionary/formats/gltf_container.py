"""What a glTF file is packed in: the chunks of a .glb, and the JSON of either kind (glTF 2.0, 4.4).

Chunks are read one by one, so that a file with a hole of gigabytes is refused from their heads.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any, BinaryIO

from motionary.errors import InputError

JSON_CHUNK, BIN_CHUNK = b"JSON", b"BIN\0"
RULE = "must be a glTF 2.0 file"
_HEAD, _MOST_CHUNKS = 12, 16  # bytes; a document, its buffer, and what extensions add
_LONGEST_TEXT = 1 << 28  # bytes; its objects take twenty times as many


def chunks(path: Path) -> tuple[dict[str, Any], int, range]:
    """The JSON of a .glb file, its length in bytes, and which bytes of the file are its binary buffer.

    Raises:
        InputError: another format, truncated, or JSON that is none.
    """
    rule = "must be a glTF 2.0 binary file"
    document, text, data, at, count = None, 0, range(0), _HEAD, 0
    with path.open("rb") as file:
        head = file.read(_HEAD)
        if head[:4] != b"glTF" or len(head) < _HEAD:
            raise InputError(path, head[:4], rule)
        (told,) = struct.unpack_from("<I", head, 8)  # what follows is none of it
        if told > path.stat().st_size:
            raise InputError(path, "truncated", rule)
        while at + 8 <= told:
            if (count := count + 1) > _MOST_CHUNKS:
                raise InputError(path, f"more than {_MOST_CHUNKS} chunks", rule)
            file.seek(at)
            length, kind = struct.unpack("<I4s", file.read(8))
            if (at := at + 8 + length) > told:
                raise InputError(path, "truncated", rule)
            if kind == JSON_CHUNK and document is None:
                document, text = parsed(path, file, length), length
            elif kind == BIN_CHUNK:
                data = range(at - length, at)
    if document is None:
        raise InputError(path, "no JSON", rule)
    return document, text, data


def packed(document: dict[str, Any], *data: bytes) -> bytes:
    """The contents of a .glb file with this JSON, and a binary buffer of these pieces."""
    text, parts = json.dumps(document, separators=(",", ":")).encode(), []
    for kind, pieces, filling in ((JSON_CHUNK, (text,), b" "), (BIN_CHUNK, data, b"\0")):
        length = sum(map(len, pieces))
        parts += [struct.pack("<I", length + -length % 4), kind, *pieces, filling * (-length % 4)]
    return b"".join([b"glTF", struct.pack("<II", 2, _HEAD + sum(map(len, parts))), *parts])


def parsed(path: Path, file: BinaryIO, length: int) -> dict[str, Any]:
    """The JSON in the next `length` bytes of an open file.

    Raises:
        InputError: it is too long, or none of an object.
    """
    if length > _LONGEST_TEXT:
        rule = f"must be at most {_LONGEST_TEXT:,}: leave buffers and images out of the text"
        raise InputError(path, f"{length:,} bytes of JSON", rule)
    try:
        document = json.loads(file.read(length).decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise InputError(path, error, RULE) from None
    if not isinstance(document, dict):
        raise InputError(path, type(document).__name__, RULE)
    return document
