"""The one error that bad input raises."""

from __future__ import annotations

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
