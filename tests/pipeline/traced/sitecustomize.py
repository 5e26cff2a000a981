"""Python imports this at every start: with TRACE_ROOT set, a process notes the files below it that it loads or reads,
one a line of TRACE_LOG."""

import os
import sys
from pathlib import PurePath


def trace(root: str, log: str) -> None:
    """Appends to `log` the path, relative to `root`, of every file that this process opens from now on."""
    file, seen = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND), set()

    def hook(event: str, arguments: tuple) -> None:
        if event != "open" or not isinstance(arguments[0], str) or not arguments[0].startswith(root + os.sep):
            return
        path, mode = PurePath(arguments[0][len(root) + 1 :]), arguments[1]
        if path.suffix == ".py" and mode == "r":
            return  # the text, which is read to be hashed; an import reads bytes
        if path.parent.name == "__pycache__":
            path = path.parent.parent / f"{path.name.split('.')[0]}.py"
        if path not in seen:
            seen.add(path)
            os.write(file, f"{path.as_posix()}\n".encode())

    sys.addaudithook(hook)


if "TRACE_ROOT" in os.environ:
    trace(os.environ["TRACE_ROOT"], os.environ["TRACE_LOG"])
