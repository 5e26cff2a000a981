"""Sends to MLflow what stages wrote down of their runs, in processes of its own, so that no stage ever waits for it.

A stage's :class:`~motionary.pipeline.tracking.Tracker` writes a journal beside the checkpoint and starts
``python -m motionary.pipeline.delivery follow JOURNAL HOME``, which sends it as it grows. ``make repro`` starts one
process for all of its stages (``watch HOME``), and none of them waits for it. What could not be sent stays, for the
stage's next run, the end of ``make repro``, or ``python -m motionary.pipeline.delivery`` in the project's root.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

from filelock import Timeout

from motionary.pipeline.journal import JOURNALS, discard, ended, lock_of, records, watched
from motionary.pipeline.sending import Replaced, Sender

_LOOK, _RETRY = 2.0, 10.0  # seconds between two looks at growing journals, and after a failure


def send_left(sender: Sender, folder: Path) -> int:
    """Sends what stages that no longer run left in the caches below `folder`; how many journals that were."""
    count = 0
    for journal in sorted(folder.glob(f"*/{JOURNALS}")):
        try:
            with lock_of(journal).acquire(timeout=0):
                if any(records(journal)):
                    sender.send(journal)
                discard(journal)
                count += 1
        except (Timeout, FileNotFoundError):
            continue  # its stage runs, or another process was first
    return count


def follow(journal: Path, home: Path, warned: bool = False) -> int:
    """Sends the journal until its stage closes standard input; exit code 1 where rows are left for later."""
    sender, first = Sender(home), True

    def send(last: bool) -> bool:
        """What is new, and before that what was left; False where the stage was killed: its next run goes on."""
        nonlocal first
        if last and not ended(journal):
            return False
        if first:
            send_left(sender, journal.parents[1])
        sender.send(journal)
        first = False
        if last:
            discard(journal)
        return True

    return _until_closed(send, sender, journal.parent, warned, "follow", str(journal), str(home))


def watch(home: Path, warned: bool = False) -> int:
    """Sends the journals of all stages that were told so, until whoever runs them closes standard input."""
    sender = Sender(home)

    def send(last: bool) -> bool:
        """What is new of stages that run, and what is left of those that do not."""
        for journal in filter(watched, left_in(home)):
            sender.send(journal)
        for folder in {journal.parents[1] for journal in left_in(home)}:
            send_left(sender, folder)
        return True

    return _until_closed(send, sender, home / ".cache", warned, "watch", str(home))


def _until_closed(send: Callable[[bool], bool], sender: Sender, folder: Path, warned: bool, *arguments: str) -> int:
    """Sends again and again until standard input has ended; exit code 1 where the last time failed.

    Args:
        send: given whether it is the last time; False is the end.
        folder: where rows are kept, for the one warning; `warned` where that was given.
        arguments: with which a process of its own begins anew, since MLflow keeps broken connections as long as one
            lives.
    """
    closed = _closing()
    while True:
        last, failed = closed.is_set(), False
        try:
            if not send(last):
                return 1
        except Exception as error:
            failed = True
            if not warned:
                warn(sender.uri, error, folder)
            warned = True
            if isinstance(error, Replaced):
                _start_anew(*arguments)
        if failed and closed.is_set():
            return 1
        if last:
            return 0
        closed.wait(_RETRY if failed else _LOOK)
        if failed and sender.client is not None:
            _start_anew(*arguments)


def left_in(home: Path) -> list[Path]:
    """The journals of the project, of stages that run and of those that no longer do."""
    return sorted((home / ".cache").glob(f"*/*/{JOURNALS}"))


def _closing() -> threading.Event:
    """Set once standard input ends. An interrupt is left to whoever holds it: an interrupted stage closes its run."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    closed = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.buffer.read(), closed.set()), daemon=True).start()
    return closed


def _start_anew(*arguments: str) -> None:
    os.execv(sys.executable, [sys.executable, "-m", "motionary.pipeline.delivery", *arguments, "--warned"])


def warn(uri: str, error: object, folder: Path) -> None:
    """The one line that a stage says of a tracking server or database that fails."""
    reason = " ".join(str(error).split())[:150] or type(error).__name__
    print(
        f"warning: MLflow at {uri}: {reason}; the stage goes on, its rows are kept in {folder} and sent later",
        file=sys.stderr,
        flush=True,
    )


def main(arguments: Sequence[str]) -> int:
    """``follow JOURNAL HOME`` for a stage, ``watch HOME`` for the stages of a run; without arguments sends what is left
    in the project of this folder."""
    if arguments[:1] == ["follow"]:
        return follow(Path(arguments[1]), Path(arguments[2]), "--warned" in arguments)
    if arguments[:1] == ["watch"]:
        return watch(Path(arguments[1]), "--warned" in arguments)
    home = Path.cwd()
    sender = Sender(home)
    try:
        count = sum(send_left(sender, folder) for folder in {journal.parents[1] for journal in left_in(home)})
    except Exception as error:
        reason = " ".join(str(error).split())[:150]
        print(f"warning: MLflow at {sender.uri}: {reason}; rows stay in {home / '.cache'}", file=sys.stderr)
        return 1
    if count:
        print(f"MLflow: sent what {count} earlier run{'s' * (count > 1)} left")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
