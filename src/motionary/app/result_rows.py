"""The page's list of what is shown: what each motion is, in words and in those of the captioner, and its files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from motionary.app import limits
from motionary.app.limits import among
from motionary.app.player import Item
from motionary.app.turns import Turns
from motionary.app.wording import file_name, plain
from motionary.app.work import FILMS, WRITABLE, file_bytes
from motionary.dictionary.dictionary import Dictionary
from motionary.systems.registry import MOTION_TO_TEXT


class ResultRows:
    """A row for each motion on show."""

    def __init__(self, client: Any, dictionary: Dictionary, turns: Turns):
        self._client, self._dictionary, self._turns = client, dictionary, turns
        self._folder = client.gui.add_folder("Results")
        self._rows: list[Any] = []
        self._listed: Sequence[Item] = ()

    def list(self, items: Sequence[Item]) -> None:
        """Replaces the rows; what the captioner says is added when it comes."""
        for row in self._rows:
            row.remove()
        self._rows, self._listed = [], items
        with self._folder:
            labels = [self._row(item, f"{k + 1}. " * (len(items) > 1)) for k, item in enumerate(items)]
        if items and self._dictionary.offering(MOTION_TO_TEXT):
            self._turns.submit(lambda: self._caption(items, labels))

    def _caption(self, items: Sequence[Item], labels: Sequence[Any]) -> None:
        """Says what the captioner reads in motions that are still on show."""
        found = self._turns.on_models(self._dictionary.caption, [item.motion for item in items])
        if self._listed is items:
            for label, (caption,) in zip(labels, found, strict=True):
                label.content += f"\n\n*Captioned:* {plain(caption)}"

    def _row(self, item: Item, number: str) -> Any:
        gui, seconds = self._client.gui, item.motion.duration
        cut = f"; films: the first {limits.MOST_VIDEO:.0f} s" * (seconds > limits.MOST_VIDEO)
        note = f"; {plain(item.note)}" if item.note else ""
        label = gui.add_markdown(f"**{plain(number + item.said)}** ({seconds:.1f} s{cut}{note})")
        buttons = gui.add_button_group("Download", [name.lstrip(".") for name in WRITABLE])
        buttons.on_click(
            lambda _: self._turns.start("Writing the file", lambda: self._write(item, f".{buttons.value}"))
        )
        self._rows += [label, buttons]
        return label

    def _write(self, item: Item, extension: str) -> None:
        """Writes the file and hands it to the browser."""
        queue = "video" if among("file", extension, WRITABLE) in FILMS else "write"
        if queue == "video":
            self._turns.say(f"⏳ Making a video of {min(item.motion.duration, limits.MOST_VIDEO):.1f} s ...")
        content = self._turns.in_process(queue, file_bytes, item.motion, extension, item.said)
        self._client.send_file_download(file_name(item.said) + extension, content, save_immediately=True)
