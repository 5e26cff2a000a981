"""What processes that were killed leave: half-written files, and processes of theirs that still run."""

from __future__ import annotations

import json
import os
import shutil
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import yaml
from filelock import FileLock, Timeout

from motionary.files import UNFINISHED, leftovers

_OLD = 3600.0  # seconds after which nobody is still writing a checkpoint


def outputs(root: Path, stage: str) -> Iterator[Path]:
    """The outs, metrics and plots that dvc.yaml declares of a stage; of `evaluation@tokenizer`, those of that item."""
    name, _, item = stage.partition("@")
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    if not (root / "dvc.yaml").is_file():
        return
    with (root / "dvc.yaml").open() as file:
        declared = yaml.load(file, loader)["stages"].get(name, {})
    declared = declared.get("do", declared)
    for entry in (*declared.get("outs", ()), *declared.get("metrics", ()), *declared.get("plots", ())):
        path = next(iter(entry)) if isinstance(entry, dict) else entry
        yield root / path.replace("${item}", item).replace("${key}", item)


def remove_unfinished(root: Path, stage: str) -> None:
    """Removes what killed runs of a stage left beside its outputs."""
    for path in outputs(root, stage):
        for left in leftovers(path):
            _remove(left)


def remove_unfinished_checkpoints(cache: Path) -> None:
    """The same for checkpoints: those of the run in `cache`, and those of the stage's other runs that are old."""
    for left in cache.parent.glob(f"*/{UNFINISHED}*"):
        if left.parent == cache or time.time() - left.stat().st_mtime > _OLD:
            _remove(left)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


class Alone:
    """Held while a stage runs under DVC: the same stage of a killed ``dvc repro`` may still be at work."""

    def __init__(self, root: Path, stage: str):
        folder = root / ".cache" / "running"
        folder.mkdir(parents=True, exist_ok=True)
        name = stage.replace("/", "_")
        self._lock, note = FileLock(folder / f"{name}.lock"), folder / f"{name}.pid"
        try:
            self._lock.acquire(timeout=0)
        except Timeout:
            process = note.read_text() if note.exists() else "?"
            say(f"stage {stage} of an earlier run still runs as process {process}; waiting for it to end")
            self._lock.acquire()
        note.write_text(str(os.getpid()))

    def release(self) -> None:
        """Lets the next one in; the system does it for a process that ends otherwise."""
        self._lock.release()


def wait_for_running(root: Path, look: float = 0.5) -> None:
    """Waits, and says so, until no DVC process works on the stages of the project in `root`.

    DVC notes who does in a file, also for the killed; where another process has got the number of such a one, it would
    take it for that one and ask for the file to be removed by hand.
    """
    note, said = root / ".dvc" / "tmp" / "rwlock", set()
    while note.is_file() and (found := _holders(note)):
        dead = {pid for pid in found if not _is_dvc(pid)}
        if dead == set(found):
            note.unlink(missing_ok=True)
            return
        for pid in set(found) - dead - said:
            say(f"process {pid} of an earlier run still runs here ({found[pid][-80:]}); waiting for it to end")
            said.add(pid)
        time.sleep(look)


def _holders(note: Path) -> dict[int, str]:
    """Process numbers and commands that DVC's file names."""
    try:
        known = json.loads(note.read_text())
        entries = [*known.get("write", {}).values(), *(e for es in known.get("read", {}).values() for e in es)]
        return {int(entry["pid"]): str(entry["cmd"]) for entry in entries if entry}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}  # being written, or for DVC to judge


def _is_dvc(pid: int) -> bool:
    try:
        process = psutil.Process(pid)
        return process.status() != psutil.STATUS_ZOMBIE and any("dvc" in part for part in process.cmdline())
    except psutil.Error:
        return False


def say(line: str) -> None:
    """A line for whoever waits."""
    print(line, file=sys.stderr, flush=True)
