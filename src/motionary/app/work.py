"""Work that visitors ask for: models in threads, files in processes, so that the page stays responsive.

Uploads are parsed in another process with a time limit: a file that hangs or breaks a parser stops nobody else.
"""

from __future__ import annotations

import io
import multiprocessing
import tempfile
import threading
import zipfile
from collections.abc import Callable
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures import TimeoutError as TookTooLong
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

from motionary.errors import InputError
from motionary.motion import Motion

MOST_BYTES = 20 * 2**20  # of an upload
MOST_UNPACKED = 200 * 2**20  # of an npz
MOST_SECONDS = 300.0  # of an uploaded motion
READABLE = (".bvh", ".npz")
WRITABLE = (".bvh", ".glb", ".mp4")
_PATIENCE = 120.0  # seconds that one file may take
_MOST_WAITING = 32


def read_upload(name: str, content: bytes) -> Motion:
    """The motion in an uploaded file; nothing in it is ever unpickled, and its name is only ever shown.

    Raises:
        InputError: another kind of file, too large, too long, or damaged: name, value and rule.
    """
    name = Path(name.replace("\\", "/")).name or "upload"
    suffix = Path(name).suffix.lower()
    if suffix not in READABLE:
        raise InputError(name, suffix or "no extension", f"only {' '.join(READABLE)} can be read here")
    if len(content) > MOST_BYTES:
        raise InputError(name, f"{len(content) / 2**20:.0f} MB", f"at most {MOST_BYTES // 2**20} MB can be read here")
    if suffix == ".npz" and _unpacked(content) > MOST_UNPACKED:
        raise InputError(name, "too large", f"at most {MOST_UNPACKED // 2**20} MB when unpacked")
    from motionary.formats import read_motion

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"upload{suffix}"
        path.write_bytes(content)
        try:
            motion = read_motion(path)
        except InputError as error:
            raise InputError(str(error.what).replace(str(path), name), error.value, error.rule) from None
    if motion.duration > MOST_SECONDS:
        raise InputError(name, f"{motion.duration:.0f} s", f"at most {MOST_SECONDS:.0f} s can be shown here")
    return motion


def _unpacked(content: bytes) -> int:
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            return sum(entry.file_size for entry in archive.infolist())
    except (zipfile.BadZipFile, ValueError, OSError):
        return 0  # the reader says what is wrong with it


def file_bytes(motion: Motion, extension: str, caption: str) -> bytes:
    """A motion as the contents of a file; `caption` is shown in videos."""
    from motionary.formats import write_motion

    with tempfile.TemporaryDirectory() as folder:
        titled: dict[str, Any] = {"captions": caption} if extension == ".mp4" and caption else {}
        return write_motion(motion, Path(folder) / f"motion{extension}", **titled).read_bytes()


class Workers:
    """Threads for what models do (they share the dictionary) and processes for files."""

    def __init__(self, threads: int = 4, processes: int = 2):
        self._threads = ThreadPoolExecutor(threads, "work")
        self._count = processes
        self._processes: Executor = self._start()
        self._lock, self._waiting = threading.Lock(), 0

    def submit(self, job: Callable[[], None]) -> bool:
        """Runs a job soon in a thread; False where too many wait already."""
        with self._lock:
            if self._waiting >= _MOST_WAITING:
                return False
            self._waiting += 1

        def run() -> None:
            """The job, then room for another."""
            try:
                job()
            finally:
                with self._lock:
                    self._waiting -= 1

        self._threads.submit(run)
        return True

    def in_process(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """The function's result, from a process of its own; waits for it.

        Raises:
            InputError: the function's own, or where it takes too long or its process dies (memory, for example).
        """
        try:
            return self._processes.submit(function, *arguments).result(_PATIENCE)
        except TookTooLong:
            self._replace()
            raise InputError("file", "given up", f"took longer than {_PATIENCE:.0f} s") from None
        except BrokenProcessPool:
            self._replace()
            raise InputError("file", "given up", "it could not be handled; is it damaged or too large?") from None

    def close(self) -> None:
        """Stops without waiting for what runs."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        _stop(self._processes)

    def _start(self) -> ProcessPoolExecutor:
        # Fresh processes: forking one that runs threads and torch can hang.
        return ProcessPoolExecutor(self._count, multiprocessing.get_context("spawn"))

    def _replace(self) -> None:
        with self._lock:
            _stop(self._processes)
            self._processes = self._start()


def _stop(pool: Executor) -> None:
    for process in list((getattr(pool, "_processes", None) or {}).values()):
        process.terminate()
    pool.shutdown(wait=False, cancel_futures=True)
