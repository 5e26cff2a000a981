"""The one error that bad input raises."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

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
