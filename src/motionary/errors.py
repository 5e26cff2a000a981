"""The one error that bad input raises."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from numbers import Integral
from typing import Any, TypeVar

T = TypeVar("T")

_LONGEST = 120


class InputError(ValueError):
    """A public input broke a rule.

    Args:
        what: the file or argument that is wrong.
        value: the offending value (shortened in the message).
        rule: what would have been right, or what to do.

    The message is one line: ``what: value: rule``. Command-line programs print it and exit with code 2.
    """

    def __init__(self, what: object, value: object, rule: str):
        shown = " ".join(str(value).split())
        if len(shown) > _LONGEST:
            shown = shown[: _LONGEST - 3] + "..."
        self.what, self.value, self.rule = str(what), value, rule
        super().__init__(f"{what}: {shown}: {rule}")

    def __reduce__(self):
        # Exceptions cross process borders (parallel preprocessing); rebuild from the three parts.
        return type(self), (self.what, str(self.value), self.rule)


class InputWarning(UserWarning):
    """An input was taken on thin or contradicting evidence; one line says what was taken and how to say otherwise."""


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


def check_whole(name: str, value: Any, least: int) -> None:
    """InputError unless `value` is a whole number (also of numpy) of at least `least`."""
    if isinstance(value, bool) or not isinstance(value, Integral) or value < least:
        raise InputError(name, value, f"must be a whole number, at least {least}")


def configure(cls: type[T], values: Mapping[str, Any], section: str) -> T:
    """A configuration dataclass from a mapping; a missing or unknown key is an InputError that names `section.key`."""
    known = {field.name for field in fields(cls)}  # type: ignore[arg-type]
    for key in values:
        if key not in known:
            raise InputError(f"{section}.{key}", values[key], f"unknown key; known are {', '.join(sorted(known))}")
    try:
        return cls(**{key: tuple(v) if isinstance(v, list) else v for key, v in values.items()})
    except TypeError as error:
        raise InputError(section, sorted(values), str(error).split("__init__() ")[-1]) from error
