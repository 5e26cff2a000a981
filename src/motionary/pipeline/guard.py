"""Runs a command that must not outlive whoever asked for it: ``python guard.py COMMAND...``, in a session of its own.

Standard input is a pipe from that process. It ends with it, also when it is killed, on every system; then all
processes of the session are interrupted, as by Ctrl-C, and after a minute killed. Needs no package, to start at once.
"""

import os
import signal
import subprocess
import sys
import threading

GRACE = 60.0  # seconds for an interrupted stage to end by itself


def start(command: list[str], folder: os.PathLike, environment: dict[str, str]) -> subprocess.Popen:
    """Starts a guarded command: its session ends once the process's standard input is closed, as it is with us."""
    # A session of its own: DVC does not pass an interrupt on, so that all of a stage's processes must be reached.
    guarded = [sys.executable, "-I", __file__, *command]
    return subprocess.Popen(guarded, cwd=folder, env=environment, stdin=subprocess.PIPE, start_new_session=True)


def watch(ended: threading.Event) -> None:
    """Stops the session once standard input ends."""
    os.read(0, 1)
    os.killpg(0, signal.SIGINT)
    if not ended.wait(GRACE):
        os.killpg(0, signal.SIGKILL)


def main(command: list[str]) -> int:
    """The command's exit code; 128 and the signal's number where one ended it."""
    # Handlers, since an ignored signal would stay ignored in what is started.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: None)
    child, ended = subprocess.Popen(command, stdin=subprocess.DEVNULL), threading.Event()
    threading.Thread(target=watch, args=(ended,), daemon=True).start()
    code = child.wait()
    ended.set()
    return code if code >= 0 else 128 - code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
