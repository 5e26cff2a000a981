"""What the page opens with: sentences to try, and a motion that plays."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from motionary.app.player import Item
from motionary.dictionary.dictionary import Dictionary
from motionary.language import annotate
from motionary.systems.registry import ACT, MOTION_TO_TEXT

PROMPTS = (
    "a person waves with the left hand",
    "a person dances",
    "a person runs",
    "a person sits down",
    "an old person walks and turns right",
    "a person jumps twice",
    "a person raises both hands",
    "a person kicks",
    "a person walks",
)
_OFFERED = 3


class Opening:
    """Made once, in the models' thread, for all visitors.

    Attributes:
        prompts: sentences to try; once the models are open, such as they know every word of, and if they have any
            whose motion their own caption calls the same.
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
            made = self._tried()
            if made:
                self.prompts = tuple(item.said for item in made)
            return (made[0] if made else self._of(self.prompts[0]),)
        if self._dictionary.offering(ACT):
            action = self._dictionary.actions[0]
            return (Item(self._dictionary.act(action)[0], action),)
        return ()

    def _tried(self) -> list[Item]:
        """Motions of three sentences whose every word the models know, those first that they do as they are told."""
        known = (text for text in PROMPTS if not self._dictionary.reading(text).line)
        done: list[Item] = []
        other: list[Item] = []
        while len(done) < _OFFERED and (text := next(known, None)) is not None:
            item = self._of(text)
            (done if self._as_told(item) else other).append(item)
        return [*done, *other][:_OFFERED]

    def _of(self, text: str) -> Item:
        return Item(self._dictionary.generate(text, system=self._generators[0])[0], text)

    def _as_told(self, item: Item) -> bool:
        """Whether the models' own caption of a motion names an action of its sentence; True where nothing captions."""
        if not self._dictionary.offering(MOTION_TO_TEXT):
            return True
        asked, read = annotate([item.said, self._dictionary.caption(item.motion)[0]])
        return any(word in read.words for word, tag in zip(asked.words, asked.tags, strict=True) if tag == "ACTION")
