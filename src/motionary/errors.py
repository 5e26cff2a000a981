"""The one error that bad input raises."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from functools import cache
from numbers import Integral, Real
from typing import Any, TypeVar, get_origin, get_type_hints

T = TypeVar("T")

_LONGEST, _LOOKED_AT = 120, 10_000


class InputError(ValueError):
    """A public input broke a rule.

    Args:
        what: the file or argument that is wrong.
        value: the offending value (shortened in the message).
        rule: what would have been right, or what to do.

    The message is one line: ``what: value: rule``. Command-line programs print it and exit with code 2.
    """

    def __init__(self, what: object, value: object, rule: str):
        self.what, self.value, self.rule = _ends(_printable(_ends(str(what), _LOOKED_AT))), value, _printable(rule)
        super().__init__(f"{self.what}: {shortened(value)}: {self.rule}")

    def of(self, file: object) -> InputError:
        """The same error with the file's name before the argument's."""
        return InputError(f"{file}, {self.what}", self.value, self.rule)

    def __reduce__(self):
        # Exceptions cross process borders (parallel preprocessing); rebuild from the three parts.
        return type(self), (self.what, shortened(self.value, 1000), self.rule)


def _ends(text: str, most: int = 1000) -> str:
    """A text without its middle where it is longer than `most`: a path's file name stands at its end."""
    return text if len(text) <= most else f"{text[: most // 4]}...{text[3 - most + most // 4 :]}"


def _printable(text: object) -> str:
    """The text as any terminal and any encoding can show it, in one line: what cannot be printed is spelled out."""
    found = str(text)
    if found.isprintable():
        return found
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "replace").decode() for c in found)


def shortened(value: object, most: int = _LONGEST) -> str:
    """A value as one line of at most `most` characters; one that Python cannot print is named by its type."""
    try:
        whole = str(value)
    except (RecursionError, ValueError):
        whole = f"a {type(value).__name__}"
    begin = whole[: max(_LOOKED_AT, most)]  # of a file of megabytes not more is made printable
    found = _printable(" ".join(begin.split()))
    return found if len(found) <= most and len(begin) == len(whole) else found[: most - 3] + "..."


KEPT = "kept as it is; use force=True to replace it"  # the rule of a file or folder that is there; a shell says --force


def exit_code(run: Callable[[], object]) -> int:
    """Runs a command: 0, or 2 after one line on standard error where an input broke a rule."""
    try:
        run()
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


class InputWarning(UserWarning):
    """An input was read on thin or contradicting evidence; one line says how it was read and how to override that."""


def check_values(section: str, config: object, names: Iterable[str], holds: Callable[[Any], bool], rule: str) -> None:
    """InputError for the first attribute of `config`, of those named, that breaks a rule.

    Args:
        section: the configuration's name, which stands before the key in the message.
        config: holds the values as attributes.
        names: of the values to check.
        holds: whether a value is right.
        rule: the same in words.
    """
    for name in names:
        if not holds(value := getattr(config, name)):
            raise InputError(f"{section}.{name}", value, rule)


# Settings beyond these are typing errors: channels of a layer, layers of a stack, a loss weight, any count.
WIDEST, DEEPEST, HEAVIEST, MOST = 65536, 64, 1_000_000, 1_000_000
MOST_ASKED, MOST_DRAWS = 10_000, 1_000  # results of one call, and draws that captions agree with
STRONGEST = 100  # times a style: far beyond what looks like anything


def check_range(section: str, config: object, names: Iterable[str], low: float, high: float) -> None:
    """InputError for the first attribute of `config`, of those named, outside of `low`..`high`; see `check_values`."""
    check_values(section, config, names, lambda value: low <= value <= high, f"must be in {low}..{high}")


def check_share(section: str, config: object, names: Iterable[str]) -> None:
    """InputError for the first attribute of `config`, of those named, outside of [0, 1); see `check_values`."""
    check_values(section, config, names, lambda value: 0 <= value < 1, "must be in [0, 1)")


def is_real(value: object) -> bool:
    """Whether a value is a number that is finite; true and false are none."""
    try:
        return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # a whole number beyond all floats
        return False


def check_whole(name: str, value: Any, least: int, most: int | None = None) -> None:
    """InputError unless `value` is a whole number (also of numpy) of at least `least`, and at most `most`."""
    if isinstance(value, bool) or not isinstance(value, Integral) or value < least or (most and int(value) > most):
        upper = f", at most {most:,}" if most else ""
        raise InputError(name, value, f"must be a whole number, at least {least}{upper}")


_hints = cache(get_type_hints)
_KINDS: dict[Any, tuple[Callable[[Any], bool], str]] = {
    bool: (lambda value: isinstance(value, bool), "must be true or false"),
    int: (lambda value: isinstance(value, Integral) and not isinstance(value, bool), "must be a whole number"),
    float: (is_real, "must be a number"),
    str: (lambda value: isinstance(value, str), "must be text"),
}


def check_kind(name: str, value: Any, kind: type) -> None:
    """InputError unless a value is of a kind: bool, int, float (any number that is finite) or str."""
    holds, rule = _KINDS[kind]
    if not holds(value):
        raise InputError(name, value, rule)


_listed = (lambda value: isinstance(value, list | tuple), "must be a list")
_anything = (lambda value: True, "")


def configure(cls: type[T], values: Mapping[str, Any], section: str) -> T:
    """A configuration dataclass from a mapping; a missing or unknown key, or a value of another
    kind (number, text, ...), is an InputError that names `section.key`."""
    known = {field.name for field in fields(cls)}  # type: ignore[arg-type]
    for key in values:
        if key not in known:
            raise InputError(f"{section}.{key}", values[key], f"unknown key; known are {', '.join(sorted(known))}")
    for name, kind in _hints(cls).items():
        if name not in values or name not in known:
            continue
        holds, rule = _KINDS.get(kind) or (_listed if get_origin(kind) is tuple else _anything)
        if not holds(values[name]):
            raise InputError(f"{section}.{name}", values[name], rule)
    try:
        return cls(**{key: tuple(v) if isinstance(v, list) else v for key, v in values.items()})
    except TypeError as error:
        raise InputError(section, sorted(values), str(error).split("__init__() ")[-1]) from error
