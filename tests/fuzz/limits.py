"""A task in a process of its own, with a limit on time and on memory: what it said, how it ended, what it took."""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SECONDS, MEGABYTES = 10.0, 700.0  # a fresh process holds 300 more


@dataclass(frozen=True)
class Outcome:
    """How a task ended.

    Attributes:
        code: what it returned; -N where signal N ended it (27: out of processor time), 1 for an exception.
        said: its standard output and error.
        seconds: of the processor; a busy machine is nobody's fault.
        megabytes: the most that it held at a time beyond what the process that forked it held.
    """

    code: int
    said: str
    seconds: float
    megabytes: float

    def faults(self, file: Path, codes: tuple[int, ...] = (0, 2)) -> list[str]:
        """What breaks the contract: a result or one line that names the file, within the limits."""
        last = (self.said.strip().splitlines() or [""])[-1]
        found = [] if self.code in codes else [f"exit {self.code}: {last[:300]}"]
        if self.code == 2 and (len(self.said.strip().splitlines()) != 1 or file.name not in self.said):
            found.append(f"not one line that names {file.name}: {self.said.strip()[:300]}")
        if "Warning" in self.said or "Traceback" in self.said:
            found.append(f"not for users: {self.said.strip()[-300:]}")
        if self.seconds > SECONDS:
            found.append(f"{self.seconds:.1f} s")
        if self.megabytes > MEGABYTES:
            found.append(f"{self.megabytes:.0f} MB")
        return found


def limited(task: Callable[..., Any], *arguments: Any, seconds: float = 2 * SECONDS) -> Outcome:
    """task(*arguments) in a fork of this process; its result is the exit code (None: 0)."""
    with tempfile.TemporaryFile("w+") as said:
        fork = multiprocessing.get_context("fork")
        process = fork.Process(target=_run, args=(said.fileno(), seconds, task, arguments))
        held = _anonymous()
        process.start()
        _, status, usage = os.wait4(process.pid, 0)
        said.seek(0)
        code = os.waitstatus_to_exitcode(status)
        return Outcome(code, said.read(), usage.ru_utime + usage.ru_stime, (usage.ru_maxrss * 1024 - held) / 2**20)


def _anonymous() -> int:
    """Bytes of memory that a fork of this process begins with: what is mapped from files comes as it is touched."""
    return int(Path("/proc/self/status").read_text().split("RssAnon:")[1].split()[0]) * 1024


def _addressed() -> int:
    """Bytes of this process's address space."""
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


def _run(said: int, seconds: float, task: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    signal.setitimer(signal.ITIMER_PROF, seconds)
    signal.setitimer(signal.ITIMER_REAL, 20 * seconds)  # for what waits and does not work
    # A guard of the machine; the contract is measured.
    resource.setrlimit(resource.RLIMIT_AS, (_addressed() + 3 * 2**30,) * 2)
    os.dup2(said, 1)
    os.dup2(said, 2)
    sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
    code = 1
    try:
        code = task(*arguments) or 0
    except SystemExit as error:
        code = int(error.code or 0)
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
