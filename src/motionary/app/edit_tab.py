"""The page's controls for changing a part of what is shown, and for going on from it."""

from __future__ import annotations

from motionary.app import limits
from motionary.app.limits import within
from motionary.app.player import Item
from motionary.app.visit import Visit
from motionary.app.wording import plain
from motionary.errors import InputError
from motionary.motion import Motion


class EditTab:
    """A motion on show, and what is to happen in a part of it, or after it."""

    def __init__(self, visit: Visit):
        self._visit, gui = visit, visit.gui
        self._menu = visit.menu("Motion to edit")
        with (form := gui.add_form(None)):
            self._text = gui.add_text("What happens", "a person jumps")
        most = limits.MOST_GENERATED
        self._start = gui.add_slider("From second", min=0.0, max=most, step=0.1, initial_value=1.0)
        self._end = gui.add_slider("To second", min=0.0, max=most, step=0.1, initial_value=2.0)
        change = gui.add_button("Change this part")
        self._longer = gui.add_slider("Seconds more", min=0.4, max=most, step=0.2, initial_value=2.0)
        go_on = gui.add_button("Go on")
        for event in (form.on_submit, change.on_click):
            event(lambda _: visit.turns.start("Editing", self._change))
        go_on.on_click(lambda _: visit.turns.start("Going on", self._go_on))

    def _change(self) -> None:
        """Makes another of the seconds that are named, and shows both."""
        before, text = self._visit.chosen(self._menu), self._text.value
        start, end = (
            within(n, c.value, 0, limits.MOST_GENERATED) for n, c in (("from", self._start), ("to", self._end))
        )
        if not start < end:
            raise InputError("from, to", f"{start:g}, {end:g}", "must be the beginning and the end of a part")
        edit = self._visit.dictionary.edit
        result = self._visit.turns.on_models(lambda: edit(before.motion, text, start=start, end=end))
        self._show(before, result, f"{before.said}; from {start:g} to {end:g} s {text}")

    def _go_on(self) -> None:
        """Makes what follows, and shows both."""
        before, text = self._visit.chosen(self._menu), self._text.value
        seconds = within("seconds more", self._longer.value, 0.4, limits.MOST_GENERATED)
        extend = self._visit.dictionary.extend
        result = self._visit.turns.on_models(lambda: extend(before.motion, seconds=seconds, text=text))
        self._show(before, result, f"{before.said}, then {text}")

    def _show(self, before: Item, result: Motion, text: str) -> None:
        after = Item(result, "after", text)
        self._visit.show([Item(before.motion, "before", before.said), after], f"Edited: {plain(text)}")
