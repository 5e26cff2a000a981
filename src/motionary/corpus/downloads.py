"""Files of public places: fetched once, gone on with where a connection broke, checked, and written down."""

from __future__ import annotations

import hashlib
import http.client
import json
import shutil
import threading
import time
import urllib.error
import urllib.request
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path

from motionary.errors import InputError
from motionary.files import readable

RECORD = "downloads.jsonl"
ATTEMPTS, WAIT, TIMEOUT = 5, 1.0, 60.0  # of one file; seconds, doubled each time; seconds without an answer
_PART = ".part"
_GONE = (401, 403, 404, 410)  # another attempt would not help


def read_manifest(path: str | Path | None) -> dict[str, str]:
    """SHA-256 by file name, from a ``downloads.jsonl`` of an earlier run or of a source that is trusted."""
    if path is None:
        return {}
    found = {}
    for number, line in enumerate(readable(path).read_text(encoding="utf-8").splitlines(), 1):
        try:
            row = json.loads(line)
            found[str(row["file"])] = str(row["sha256"]).lower()
        except (ValueError, KeyError, TypeError):
            rule = 'must be lines of JSON with "file" and "sha256"'
            raise InputError(f"{path}:{number}", line, rule) from None
    return found


class Downloads:
    """A folder of downloaded files, and ``downloads.jsonl``, which says of each its URL, licence, bytes and SHA-256.

    Args:
        folder: is made where it is missing.
        expected: SHA-256 by file name; a file that differs is refused. Files that it lacks are taken as they come.
        attempts, wait: how often a file is tried, and seconds before the second time, doubled for each further one.
    """

    def __init__(
        self, folder: Path, expected: Mapping[str, str] | None = None, attempts: int = ATTEMPTS, wait: float = WAIT
    ):
        self.folder, self.expected, self.attempts, self.wait = folder, dict(expected or {}), attempts, wait
        folder.mkdir(parents=True, exist_ok=True)
        self._recording = threading.Lock()
        self._fetching: defaultdict[str, threading.Lock] = defaultdict(threading.Lock)

    def get(self, name: str, url: str, licence: str) -> Path:
        """The file, fetched unless it is there.

        Raises:
            InputError: it cannot be had, or is not what the manifest says; nothing under its name is left then.
        """
        with self._fetching[name]:  # a skeleton is asked for by every take of its subject at once
            return self._get(name, url, licence)

    def _get(self, name: str, url: str, licence: str) -> Path:
        path = self.folder / name
        if path.is_file():
            self._check(path, name)
            return path
        part = path.with_name(path.name + _PART)
        self._fetch(url, part)
        digest = self._check(part, name)
        row = {"file": name, "url": url, "licence": licence, "bytes": part.stat().st_size, "sha256": digest}
        with self._recording, (self.folder / RECORD).open("a", encoding="utf-8") as record:
            record.write(json.dumps(row) + "\n")
        part.replace(path)
        return path

    def _check(self, path: Path, name: str) -> str:
        """The SHA-256 of a file; one that is not the manifest's is removed."""
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        if self.expected.get(name, digest) != digest:
            path.unlink()
            raise InputError(name, f"SHA-256 {digest}", f"must be {self.expected[name]}, as the manifest says; removed")
        return digest

    def _fetch(self, url: str, part: Path) -> None:
        for attempt in range(self.attempts):
            try:
                return resume(url, part)
            except urllib.error.HTTPError as error:
                if error.code in _GONE:
                    raise InputError(url, f"{error.code} {error.reason}", "is not there or may not be had") from None
                if error.code == 416:  # what is here is longer than what is there
                    part.unlink(missing_ok=True)
                last: Exception = error
            except (OSError, http.client.HTTPException, ValueError) as error:
                last = error
            if attempt + 1 < self.attempts:
                time.sleep(self.wait * 2**attempt)
        rule = f"no answer in {self.attempts} attempts; run the same again to go on from here"
        raise InputError(url, last, rule)


def resume(url: str, part: Path) -> None:
    """Fetch what a partial file lacks; OSError where less came than was promised."""
    have = part.stat().st_size if part.is_file() else 0
    request = urllib.request.Request(url, headers={"Range": f"bytes={have}-"} if have else {})
    with urllib.request.urlopen(request, timeout=TIMEOUT) as answer:
        going_on = answer.status == 206
        promised = int(answer.headers.get("Content-Length", -1))
        with part.open("ab" if going_on else "wb") as file:
            shutil.copyfileobj(answer, file)
    whole = promised + (have if going_on else 0)
    if promised >= 0 and part.stat().st_size != whole:
        raise OSError(f"ended after {part.stat().st_size} of {whole} bytes")
