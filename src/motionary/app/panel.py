"""What one visitor sees and asks: prompts, uploads, searches, results, playback. Nothing here is shared but models."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from motionary.app.act_tab import build_act_tab
from motionary.app.blend_tab import build_blend_tab
from motionary.app.describe_tab import DescribeTab
from motionary.app.edit_tab import EditTab
from motionary.app.generate_tab import GenerateTab
from motionary.app.opening import Opening
from motionary.app.play_controls import PlayControls
from motionary.app.player import Item
from motionary.app.result_rows import ResultRows
from motionary.app.search_tab import build_search_tab
from motionary.app.style_tab import StyleTab
from motionary.app.turns import READY, Turns
from motionary.app.visit import Visit
from motionary.app.work import Workers
from motionary.dictionary.dictionary import Dictionary
from motionary.systems.registry import ACT, BLEND, INFILL, MOTION_TO_TEXT, SEARCH, STYLIZE

_WHAT = "Say what a person does and see the motion, or upload a motion and read what it does."


class Panel:
    """The controls of one visitor. What they ask for runs one at a time; see :class:`Turns`."""

    def __init__(
        self, client: Any, dictionary: Dictionary, workers: Workers, generators: Sequence[str], opening: Opening
    ):
        gui = client.gui
        gui.add_markdown(_WHAT)
        self._turns = Turns(client, workers)
        self._opening = opening
        self._generate: GenerateTab | None = None
        self._visit = Visit(gui, dictionary, self._turns, self._show)
        self._build_tabs(generators)
        self._play = PlayControls(client, self._turns)
        self._rows = ResultRows(client, dictionary, self._turns)
        self.player = self._play.player
        self._turns.submit(self._open)

    def close(self) -> None:
        """Ends playback and what is being done for this visitor."""
        self._turns.close()
        self.player.close()

    def _build_tabs(self, generators: Sequence[str]) -> None:
        """A tab for each thing that the models can do."""
        visit, tabs, can = self._visit, self._visit.gui.add_tab_group(), self._visit.dictionary.offering
        if generators:
            with tabs.add_tab("Generate"):
                self._generate = GenerateTab(visit, generators, self._opening.prompts)
        if generators or can(INFILL):
            with tabs.add_tab("Edit"):
                EditTab(visit)
        if can(BLEND):
            with tabs.add_tab("Blend"):
                build_blend_tab(visit)
        if can(ACT):
            with tabs.add_tab("Act"):
                build_act_tab(visit)
        if can(STYLIZE):
            with tabs.add_tab("Style"):
                StyleTab(visit)
        with tabs.add_tab("Read"):
            DescribeTab(visit, bool(can(MOTION_TO_TEXT)))
        if can(SEARCH):
            with tabs.add_tab("Search"):
                build_search_tab(visit)

    def _open(self) -> None:
        """Shows the first motion to who has not asked for another."""
        items = self._turns.on_models(self._opening.items)
        if self._generate is not None:
            self._generate.suggest(self._opening.prompts)
        if items and not self._turns.asked:
            self._visit.show(items, READY)

    def _show(self, items: Sequence[Item]) -> None:
        self.player.show(items)
        self._play.reset()
        self._rows.list(items)
