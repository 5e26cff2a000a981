"""The page's controls for another style of what is shown."""

from __future__ import annotations

from typing import Any

from motionary.app import limits
from motionary.app.limits import among, within
from motionary.app.player import Item
from motionary.app.uploads import take
from motionary.app.visit import Visit
from motionary.app.wording import plain
from motionary.app.work import READABLE, read_upload
from motionary.errors import InputError
from motionary.motion import Motion

_CHANCE, _REFERENCE = "by chance", "of the reference"


class StyleTab:
    """A motion on show, and the style that it gets: of a label, of an uploaded motion, or drawn."""

    def __init__(self, visit: Visit):
        self._visit, gui = visit, visit.gui
        self._reference: Motion | None = None
        self._menu = visit.menu("Motion to restyle")
        self._style = gui.add_dropdown("Style", (_CHANCE, _REFERENCE))
        self._upload = gui.add_upload_button("Upload a reference", mime_type=",".join(READABLE))
        self._strength = gui.add_slider("Strength", min=0.0, max=limits.MOST_STRENGTH, step=0.05, initial_value=1.0)
        self._seed = visit.seed("Style seed")
        self._feet = gui.add_checkbox("Stylized feet stand", True, hint=limits.FEET)
        button = gui.add_button("Stylize")
        visit.turns.submit(self._offer)
        self._upload.on_upload(lambda _: visit.turns.start("Reading the reference", self._read))
        button.on_click(lambda _: visit.turns.start("Stylizing", self._work))

    def _offer(self) -> None:
        """Offers the known styles, once the models are open."""
        known = self._visit.turns.on_models(lambda: self._visit.dictionary.styles)
        self._style.options = (_CHANCE, _REFERENCE, *known)

    def _read(self) -> None:
        """Keeps the uploaded motion as the reference."""
        file = take(self._upload)
        self._reference = self._visit.turns.in_process("read", read_upload, file.name, file.content)
        self._style.value = _REFERENCE
        self._visit.turns.say(f"Reference: {plain(file.name)}")

    def _work(self) -> None:
        """Stylizes what the menu names, and shows both."""
        visit, style = self._visit, among("style", self._style.value, self._style.options)
        before = visit.chosen(self._menu)
        given: dict[str, Any] = {"seed": visit.seeded(self._seed), "feet": bool(self._feet.value)}
        given["strength"] = within("strength", self._strength.value, 0, limits.MOST_STRENGTH)
        if style == _REFERENCE:
            if self._reference is None:
                raise InputError("reference", "none", "upload one first")
            given["reference"] = self._reference
        elif style != _CHANCE:
            given["style"] = style
        (result,) = visit.turns.on_models(lambda: visit.dictionary.stylize(before.motion, **given))
        said = f"Stylized: {style}, strength {given['strength']:g}, seed {given['seed']}"
        after = Item(result, f"style {style}", f"{before.said}, style {style}")
        visit.show([Item(before.motion, "before", before.said), after], plain(said))
