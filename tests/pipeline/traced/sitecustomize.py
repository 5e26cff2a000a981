"""Python imports this at every start: with TRACE_ROOT set, a process notes the files below it that it loads or reads,
and the functions and classes of the project that it calls as ``file:name``, one a line of TRACE_LOG."""

import ast
import os
import sys
from importlib.machinery import SourceFileLoader
from pathlib import PurePath

_seen: set[str] = set()
_log: list[int] = []


def called(place: str) -> None:
    """Notes that a function or a method runs; each calls this first."""
    if place not in _seen:
        _seen.add(place)
        os.write(_log[0], f"{place}\n".encode())


def note_calls(root: str) -> None:
    """Has every module below `root`/src that is imported from now on tell what of it is called."""
    compiled = SourceFileLoader.source_to_code

    def noting(loader: SourceFileLoader, data, path: str, **options):
        if not str(path).startswith(os.path.join(root, "src", "")):
            return compiled(loader, data, path, **options)
        tree = ast.parse(data)
        for top in (node for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)):
            place = f"{PurePath(path).relative_to(root).as_posix()}:{top.name}"
            note = f"__import__('sitecustomize').called({place!r})"
            for function in (node for node in ast.walk(top) if isinstance(node, ast.FunctionDef)):
                documented = ast.get_docstring(function, clean=False) is not None
                function.body.insert(1 if documented else 0, ast.parse(note).body[0])
        return compile(ast.fix_missing_locations(tree), path, "exec", dont_inherit=True)

    SourceFileLoader.source_to_code = noting


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
    _log[:] = [file]
    note_calls(root)


if "TRACE_ROOT" in os.environ:
    trace(os.environ["TRACE_ROOT"], os.environ["TRACE_LOG"])
