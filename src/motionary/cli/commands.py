"""The commands of the shell, one file each, and what runs them. Bad input is one line on standard error."""

from __future__ import annotations

import codecs
import io
import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from motionary.cli import (
    act,
    app,
    bundle,
    caption,
    convert,
    edit,
    export,
    fetch,
    generate,
    index,
    inspect,
    search,
    stylize,
    view,
)
from motionary.cli.command import build_parser
from motionary.errors import KEPT, InputError, InputWarning

COMMANDS = tuple(
    module.COMMAND
    for module in (
        generate,
        edit,
        caption,
        stylize,
        act,
        search,
        index,
        inspect,
        convert,
        export,
        fetch,
        view,
        app,
        bundle,
    )
)


def _any_name(error: UnicodeError) -> tuple[str | bytes, int]:
    """Writes the bytes of a file's name that are no text as they are, so that a script can open what is printed, and
    spells out what else cannot be written."""
    assert isinstance(error, UnicodeEncodeError)
    try:
        return codecs.lookup_error("surrogateescape")(error)
    except UnicodeError:
        return codecs.lookup_error("backslashreplace")(error)


codecs.register_error("motionary", _any_name)


@contextmanager
def _short_warnings() -> Iterator[None]:
    """A doubt about how a file was read is one line, like an error, and is said for every file once its result stands:
    what ends in an error says that alone."""
    doubts: list[str] = []

    def show(message, category, filename, lineno, file=None, line=None) -> None:
        """Keeps doubts for the end, and shows any other warning as usual."""
        if issubclass(category, InputWarning):
            doubts.append(f"warning: {message}")
        else:
            usual(message, category, filename, lineno, file, line)

    with warnings.catch_warnings():
        usual, warnings.showwarning = warnings.showwarning, show
        warnings.simplefilter("always", InputWarning)
        yield
    for doubt in doubts:
        print(doubt, file=sys.stderr)


def _open_streams() -> None:
    """Whoever starts a command may have closed its standard streams, which are then None: nothing is read or said."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), mode))


def _in_a_shell(error: InputError) -> InputError:
    """The error with the option in the place of the argument that Python would take."""
    if error.rule != KEPT:
        return error
    return InputError(error.what, error.value, "kept as it is; use --force to replace it")


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command and returns its exit code: 0, 2 on bad input (one bad file of several), 130 when interrupted."""
    _open_streams()
    try:
        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(errors="motionary")
        options = build_parser(COMMANDS).parse_args(arguments)
        with _short_warnings():
            options.run(options)
        sys.stdout.flush()
        return 2 if options.failed else 0
    except BrokenPipeError:  # the reader of a pipe went away, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except InputError as error:
        print(f"error: {_in_a_shell(error)}", file=sys.stderr)
        return 2
    except OSError as error:
        file = error.filename if isinstance(error.filename, str) else "a file"
        print(f"error: {InputError(file, error.strerror or error, 'must be readable or writable')}", file=sys.stderr)
        return 2
    except MemoryError:
        print("error: memory: full: the input or what was asked for needs more than is free", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
