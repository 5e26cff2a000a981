"""A function in a process of its own, which may hang, die or want all memory without harming anything else.

The processes are forked from a small one that has the readers and writers loaded and runs no threads: one job costs
20 ms, where a fresh interpreter takes 0.5 s. (Forking the page itself, which runs threads and torch, can hang.)
"""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
import tempfile
import time
import traceback
from collections.abc import Callable
from concurrent.futures import CancelledError
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from motionary.errors import InputError

_MEMORY = 3 * 2**30  # bytes of address space; an idle process has 0.1 GiB
_GLANCE = 0.1  # seconds between two looks whether the result is still wanted
_FORKING = multiprocessing.get_context("forkserver")
_FORKING.set_forkserver_preload(
    ["motionary.cli"]
    + [f"motionary.formats.{name}" for name in ("read.arrays", "read.bvh", "write.gltf", "write.bvh_writer")]
    + ["motionary.formats.render.video"]
)


def apart(
    function: Callable[..., Any], arguments: tuple, patience: float, wanted: Callable[[], bool], nice: int = 0
) -> Any:
    """What the function returns; waits for it.

    Args:
        function, arguments: picklable; temporary files of the function go when it ends, however it ends.
        patience: seconds that it may take.
        wanted: asked meanwhile; where it says no, the process is ended.
        nice: how far the process steps back where the machine is busy.

    Raises:
        InputError: the function's own, or where it takes too long, too much memory, or dies.
        CancelledError: no longer wanted.
    """
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        here, there = _FORKING.Pipe(duplex=False)
        given = (there, folder, patience, nice, function, arguments)
        process = _FORKING.Process(target=_work, args=given, daemon=True)
        try:
            process.start()
            there.close()
            end = time.monotonic() + patience
            while not here.poll(_GLANCE):
                if not wanted():
                    raise CancelledError
                if time.monotonic() > end:
                    raise InputError("file", "given up", f"took longer than {patience:g} s")
            done, result = here.recv()
        except (EOFError, ConnectionError, BrokenPipeError):
            raise InputError("file", "given up", "it could not be handled; is it damaged or too large?") from None
        finally:
            _end(process)
            here.close()
            there.close()
    if not done:
        raise result
    return result


def _end(process: Any) -> None:
    """Ends a process with all that it has started (ffmpeg)."""
    if process.pid is None:
        return
    if process.is_alive():
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
        process.kill()  # it may have no group of its own yet
    process.join()


def _work(there: Connection, folder: str, patience: float, nice: int, function: Callable, arguments: tuple) -> None:
    os.setsid()  # a group of its own, which Ctrl-C in the page's terminal does not reach: the page ends it
    os.nice(nice)
    tempfile.tempdir = folder
    seconds = 4 * int(patience + 1)  # of all threads: ends what outlives a page that was killed
    for limit, most in ((resource.RLIMIT_AS, _MEMORY), (resource.RLIMIT_CPU, seconds)):
        with suppress(ValueError, OSError):  # some systems have lower ones, or none
            resource.setrlimit(limit, (most, most))
    try:
        answer = True, function(*arguments)
    except MemoryError:
        answer = False, InputError("file", "given up", f"takes more than {_MEMORY // 2**30} GB of memory")
    except Exception as error:
        if not isinstance(error, InputError):
            error.add_note(traceback.format_exc())  # its traceback stays behind in this process
        answer = False, error
    try:
        there.send(answer)
    except (TypeError, AttributeError, ValueError) as error:  # what cannot be pickled
        there.send((False, RuntimeError(f"{type(answer[1]).__name__} cannot be handed on: {error}")))
