"""What a stage writes down of its run until MLflow has it, and whether what should take it answers."""

from __future__ import annotations

import json
import os
import sqlite3
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any

from filelock import FileLock

JOURNALS = "tracking-*.jsonl"
WATCHED = "MOTIONARY_WATCHED"  # set by whoever runs stages and sends their journals itself
ARTIFACTS = "mlartifacts"  # the folder of figures and reports that runs keep
_PROBE = 5.0  # seconds for a server or a database to show that it answers


def tracking_uri(home: Path) -> str:
    """``MLFLOW_TRACKING_URI`` where it is set, otherwise the SQLite database in the project's root."""
    return os.environ.get("MLFLOW_TRACKING_URI") or f"sqlite:///{home / 'mlflow.db'}"


def sweep_name(folder: Path) -> str:
    """What MLflow calls the run that holds those of the Hydra sweep in `folder`."""
    return f"sweep {folder.parent.name} {folder.name}"


def lock_of(journal: Path) -> FileLock:
    """Held by the stage that writes the journal, then by whoever sends what it left."""
    return FileLock(journal.with_suffix(".lock"))


def probe(uri: str) -> None:
    """Raises OSError or sqlite3.Error within seconds where a server does not answer or a database cannot be written."""
    if uri.startswith("sqlite:///") and Path(uri.removeprefix("sqlite:///")).exists():
        database = sqlite3.connect(uri.removeprefix("sqlite:///"), timeout=_PROBE)
        try:
            database.execute("BEGIN IMMEDIATE")
            database.rollback()
        finally:
            database.close()
    elif uri.startswith(("http://", "https://")):
        with suppress(urllib.error.HTTPError):  # which is an answer, too
            urllib.request.urlopen(uri.rstrip("/") + "/health", timeout=_PROBE).close()


def records(journal: Path, start: int = 0) -> Iterator[tuple[dict[str, Any], int]]:
    """(record, offset of the next) from byte `start`; a line that a killed stage or machine broke is left out."""
    with journal.open("rb") as file:
        file.seek(start)
        for line in file:
            start += len(line)
            try:
                record = json.loads(line)
            except ValueError:
                continue
            if line.endswith(b"\n"):
                yield record, start


def ended(journal: Path) -> bool:
    """Whether the stage closed it."""
    return any(record["kind"] == "end" for record, _ in records(journal))


def watched(journal: Path) -> bool:
    """Whether whoever runs the stage sends it, and no process of its own does."""
    with suppress(FileNotFoundError):
        return any(record.get("watched", False) for record, _ in islice(records(journal), 1))
    return False


def identity(uri: str) -> tuple[int, int] | None:
    """What tells a database file from another of the same name; None where there is no file."""
    path = Path(uri.removeprefix("sqlite:///"))
    if not uri.startswith("sqlite:///") or not path.exists():
        return None
    return path.stat().st_dev, path.stat().st_ino


def rehome(home: Path) -> None:
    """Runs of a project that was moved find their files again: MLflow keeps whole paths, here of ``mlartifacts/``."""
    path = Path(tracking_uri(home).removeprefix("sqlite:///"))
    if not tracking_uri(home).startswith("sqlite:///") or not path.exists():
        return
    here, part = home.as_uri(), f"/{ARTIFACTS}/"
    database = sqlite3.connect(path, timeout=_PROBE)
    try:
        for table, column in (("experiments", "artifact_location"), ("runs", "artifact_uri")):
            moved = f"{column} LIKE 'file://%{part}%' AND {column} NOT LIKE ? || '{part}%'"
            rest = f"? || substr({column}, instr({column}, '{part}'))"
            database.execute(f"UPDATE {table} SET {column} = {rest} WHERE {moved}", (here, here))
        database.commit()
    finally:
        database.close()


def discard(journal: Path) -> None:
    """Removes a journal that was sent."""
    for path in (journal, journal.with_suffix(".sent"), journal.with_suffix(".lock")):
        path.unlink(missing_ok=True)
