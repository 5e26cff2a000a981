"""From a file's extension to the function that reads or writes it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from inspect import Parameter, signature
from pathlib import Path
from typing import Any

import numpy as np

from motionary.errors import InputError

DAMAGED_RIG = "cannot be read as a character (damaged?)"


def function_of(path: str | os.PathLike, table: Mapping[str, str], done: str) -> Callable[..., Any]:
    """The function that `table` names for the path's extension as "module:function"; InputError lists what it has."""
    extension = Path(path).suffix.lower()
    if extension not in table:
        raise InputError(path, extension or "no extension", f"only {' '.join(table)} can be {done}")
    module, name = table[extension].split(":")
    return getattr(import_module(module), name)


def given(function: Callable[..., Any], path: str | os.PathLike, options: dict[str, Any]) -> dict[str, Any]:
    """The options that are given, all of which the format must know."""
    options = {name: value for name, value in options.items() if value is not None}
    names = [name for name, option in signature(function).parameters.items() if option.default is not Parameter.empty]
    for name in options:
        if name not in names or name == "force":
            raise InputError(path, name, f"no option of this format; it has {', '.join(names)}")
    return options


@contextmanager
def about(path: str | os.PathLike) -> Iterator[None]:
    """Complaints of the block name the file that they are about."""
    try:
        yield
    except InputError as error:
        raise error if str(path) in error.what else error.of(path) from None


@contextmanager
def foreseen(path: str | os.PathLike, rule: str) -> Iterator[None]:
    """An unforeseen failure on a file becomes one InputError with the file's name, the kind of failure and the rule.

    numpy says nothing meanwhile: infinities and NaN are refused where a motion is made, and the ways to them need no
    lines of their own.
    """
    try:
        with np.errstate(all="ignore"):
            yield
    except (InputError, OSError):
        raise
    except MemoryError:
        raise InputError(path, "too large", "must fit into this machine's memory") from None
    except Exception as error:
        raise InputError(path, f"{type(error).__name__}: {error}", rule) from error
