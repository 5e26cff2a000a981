"""The page's controls for a visitor's own motion and for sentences that describe a motion."""

from __future__ import annotations

from motionary.app import limits
from motionary.app.limits import within
from motionary.app.player import Item
from motionary.app.uploads import take
from motionary.app.visit import Visit
from motionary.app.wording import listed, plain, short
from motionary.app.work import READABLE, read_upload


class DescribeTab:
    """A motion file to show; what is on show in words."""

    def __init__(self, visit: Visit, captions: bool):
        """`captions`: whether the models can caption."""
        self._visit, gui = visit, visit.gui
        kinds = ", ".join(name.lstrip(".").upper() for name in READABLE)
        self._upload = gui.add_upload_button(f"Upload a motion ({kinds})", mime_type=",".join(READABLE))
        self._upload.on_upload(lambda _: visit.turns.start("Reading the motion", self._read))
        self._captions = captions
        if captions:
            self._menu = visit.menu("Motion to describe")
            self._count = gui.add_slider("Sentences", min=1, max=limits.MOST_VARIANTS, step=1, initial_value=3)
            hint = "the sentences that agree best with so many that are drawn by chance; 0 takes the likeliest"
            self._draws = gui.add_slider(
                "Consensus of", min=0, max=limits.MOST_DRAWS, step=10, initial_value=0, hint=hint
            )
            gui.add_button("Describe").on_click(lambda _: visit.turns.start("Describing", self._describe))
            self._said = gui.add_markdown("")

    def _read(self) -> None:
        """Reads the upload, shows it and describes it."""
        file = take(self._upload)
        motion = self._visit.turns.in_process("read", read_upload, file.name, file.content)
        said = f"{plain(file.name)}: {motion.duration:.1f} s"
        self._visit.show([Item(motion, short(file.name))], said)
        if self._captions:
            self._describe()

    def _describe(self) -> None:
        """Lists sentences that describe what the menu names."""
        item = self._visit.chosen(self._menu)
        n = int(within("sentences", self._count.value, 1, limits.MOST_VARIANTS))
        draws = int(within("consensus", self._draws.value, 0, limits.MOST_DRAWS))
        caption = self._visit.dictionary.caption
        found = self._visit.turns.on_models(lambda: caption(item.motion, n, consensus=draws))
        self._said.content = f"**Captions** of {plain(item.said)}\n\n{listed(found)}"
