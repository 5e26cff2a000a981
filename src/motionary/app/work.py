"""Work that visitors ask for, in queues that do not wait for each other, so that the page stays responsive.

Every file is read or written in a process of its own with limits of time and memory: one that hangs or breaks a
parser stops nobody else.
"""

from __future__ import annotations

import io
import tempfile
import threading
import zipfile
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motionary.app.apart import apart
from motionary.app.limits import MOST_BYTES, MOST_PLACES, MOST_SECONDS, MOST_UNPACKED, MOST_VIDEO, among
from motionary.errors import InputError
from motionary.motion import Motion

READABLE = (".bvh", ".npz")
WRITABLE = (".bvh", ".glb", ".npz", ".npy", ".mp4", ".gif", ".html")
FILMS = (".mp4", ".gif")  # drawn frame by frame
CAPTIONED = (*FILMS, ".html")
_MOST_WAITING = 64  # jobs of all visitors


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
    if (places := motion.frames * len(motion.skeleton.joints)) > MOST_PLACES:
        rule = f"at most {MOST_PLACES:,} joints times frames can be shown here"
        raise InputError(name, f"{places:,}", rule)
    return motion


def _unpacked(content: bytes) -> int:
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            return sum(entry.file_size for entry in archive.infolist())
    except (zipfile.BadZipFile, ValueError, OSError):
        return 0  # the reader says what is wrong with it


def file_bytes(motion: Motion, extension: str, caption: str) -> bytes:
    """A motion as the contents of a file; films show its first minute, and a page that plays it too; and `caption`.

    Raises:
        InputError: an extension that is not in `WRITABLE`.
    """
    from motionary.formats import write_motion

    among("file", extension, WRITABLE)
    if extension in CAPTIONED:
        motion = motion.crop(0, min(motion.frames, round(MOST_VIDEO * motion.fps)))
    with tempfile.TemporaryDirectory() as folder:
        titled: dict[str, Any] = {"captions": caption} if extension in CAPTIONED and caption else {}
        return write_motion(motion, Path(folder) / f"motion{extension}", **titled).read_bytes()


@dataclass(frozen=True)
class Queue:
    """How many jobs of a kind run at a time, each in a process, and what one may take.

    Attributes:
        places: at a time.
        patience: seconds from a job's own beginning; what it waits for its turn is not counted.
        nice: how far it steps back where the machine is busy.
    """

    places: int
    patience: float
    nice: int = 0


QUEUES = {"read": Queue(2, 30.0), "write": Queue(2, 60.0), "video": Queue(1, 180.0, nice=10)}


class Workers:
    """A queue each for reading, writing and videos, in processes, and one for models, in one thread.

    Whoever comes first is served first, and a visitor has one job at a time: nobody waits for more than one job of
    each other visitor, and for jobs of the same kind only. Models have one thread since they take turns anyway (they
    share the dictionary's lock), and a lock does not keep the order. Videos take a thousand times what other files
    take, so they do not stand in their way.
    """

    def __init__(self, queues: Mapping[str, Queue] = QUEUES):
        self.queues = queues
        self._jobs = ThreadPoolExecutor(_MOST_WAITING, "job")
        self._turns = {name: ThreadPoolExecutor(queue.places, name) for name, queue in queues.items()}
        self._models = ThreadPoolExecutor(1, "models")
        self._lock, self._waiting, self._closed = threading.Lock(), 0, False

    def submit(self, job: Callable[[], None]) -> bool:
        """Runs at once what a visitor has asked for, which waits in the queues; False where too many wait already."""
        with self._lock:
            if self._closed or self._waiting >= _MOST_WAITING:
                return False
            self._waiting += 1

        def run() -> None:
            """The job, then room for another."""
            try:
                job()
            finally:
                with self._lock:
                    self._waiting -= 1

        self._jobs.submit(run)
        return True

    def on_models(self, wanted: Callable[[], bool], function: Callable[..., Any], *arguments: Any) -> Any:
        """The function's result, in the models' thread; waits for its turn and for it.

        Raises:
            CancelledError: not `wanted` when its turn came.
        """

        def turn() -> Any:
            """The function, unless it came too late."""
            if not wanted():
                raise CancelledError
            return function(*arguments)

        return self._models.submit(turn).result()

    def in_process(self, queue: str, wanted: Callable[[], bool], function: Callable[..., Any], *arguments: Any) -> Any:
        """The function's result, from a process of its own; waits for its turn in a queue and for it.

        Raises:
            InputError: see :func:`apart`.
            CancelledError: no longer `wanted`; it is ended if it runs.
        """
        kind = self.queues[queue]

        def turn() -> Any:
            """The function, unless it came too late."""
            if not still():
                raise CancelledError
            return apart(function, arguments, kind.patience, still, kind.nice)

        def still() -> bool:
            """Whether anybody waits for it."""
            return not self._closed and wanted()

        return self._turns[queue].submit(turn).result()

    def close(self) -> None:
        """Ends the processes and drops what waits; does not wait for models."""
        self._closed = True
        for pool in (self._jobs, self._models, *self._turns.values()):
            pool.shutdown(wait=False, cancel_futures=True)
