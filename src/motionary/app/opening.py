"""What the page opens with: sentences to try, and a motion that plays."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from motionary.app.player import Item
from motionary.dictionary.dictionary import Dictionary
from motionary.systems.registry import ACT

PROMPTS = (
    "a person waves with the left hand",
    "an old person walks and turns right",
    "a person jumps twice",
    "a person raises both hands",
    "a person runs",
    "a person kicks",
    "a person sits down",
    "a person walks",
)
_OFFERED = 3


class Opening:
    """Made once, in the models' thread, for all visitors.

    Attributes:
        prompts: sentences to try; once the models are open, such as they know every word of.
    """

    def __init__(self, dictionary: Dictionary, generators: Sequence[str]):
        self.prompts: tuple[str, ...] = PROMPTS[:_OFFERED]
        self._dictionary, self._generators = dictionary, tuple(generators)
        self._items: tuple[Item, ...] | None = None

    def items(self) -> tuple[Item, ...]:
        """A motion of the first sentence, or else of the first action; none where the models make none."""
        if self._items is None:
            self._items = ()
            try:
                self._items = self._made()
            except Exception as error:  # it is said again, to whoever asks
                print(f"warning: {error}", file=sys.stderr)
        return self._items

    def _made(self) -> tuple[Item, ...]:
        if self._generators:
            self.prompts = self._known() or self.prompts
            text = self.prompts[0]
            return (Item(self._dictionary.generate(text, system=self._generators[0])[0], text),)
        if self._dictionary.offering(ACT):
            action = self._dictionary.actions[0]
            return (Item(self._dictionary.act(action)[0], action),)
        return ()

    def _known(self) -> tuple[str, ...]:
        """The first sentences of which the models know every word."""
        known = (text for text in PROMPTS if not self._dictionary.reading(text).line)
        return tuple(text for _, text in zip(range(_OFFERED), known, strict=False))
