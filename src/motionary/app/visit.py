"""What the tabs of one visitor share: controls, models, turns, and the motions that are on show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from motionary.app import limits
from motionary.app.limits import among, within
from motionary.app.player import Item
from motionary.app.turns import Turns
from motionary.app.wording import short
from motionary.dictionary.dictionary import Dictionary
from motionary.errors import InputError

_NOTHING = ("nothing yet",)


class Visit:
    """One visitor's.

    Attributes:
        gui: the page's controls.
        dictionary: the models, which all visitors share.
        turns: what runs, one job at a time.
        items: the motions on show.
    """

    def __init__(self, gui: Any, dictionary: Dictionary, turns: Turns, show: Callable[[Sequence[Item]], None]):
        """`show` puts motions on show."""
        self.gui, self.dictionary, self.turns = gui, dictionary, turns
        self.items: tuple[Item, ...] = ()
        self._show, self._menus = show, []

    def show(self, items: Sequence[Item], said: str) -> None:
        """Puts motions on show, to be worked on, and says what they are (markdown)."""
        self.items = tuple(items)
        self._show(items)
        for menu in self._menus:
            menu.options = self._names()
        self.turns.say(said)

    def menu(self, label: str = "Motion") -> Any:
        """A menu of the motions on show."""
        self._menus.append(self.gui.add_dropdown(label, self._names()))
        return self._menus[-1]

    def chosen(self, menu: Any) -> Item:
        """The motion on show that a menu names; InputError where there is none."""
        if not self.items:
            raise InputError("motion", "none", "generate or upload one first")
        return self.items[self._names().index(among("motion", menu.value, self._names()))]

    def seed(self, label: str = "Seed") -> Any:
        """A box for a seed."""
        return self.gui.add_number(label, 0, min=0, max=limits.LARGEST_SEED, step=1)

    def seeded(self, box: Any) -> int:
        """The seed in a box of :meth:`seed`, as a whole number."""
        return int(within("seed", box.value, 0, limits.LARGEST_SEED))

    def _names(self) -> tuple[str, ...]:
        return tuple(f"{k + 1}. {short(item.said)}" for k, item in enumerate(self.items)) or _NOTHING
