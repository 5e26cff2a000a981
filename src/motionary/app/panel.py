"""What one visitor sees and asks: prompts, uploads, searches, results, playback. Nothing here is shared but models."""

from __future__ import annotations

import re
import threading
import traceback
from collections.abc import Callable, Sequence
from typing import Any

from motionary.app.figures import LOOKS
from motionary.app.player import Item, Player
from motionary.app.work import READABLE, WRITABLE, Workers, file_bytes, read_upload
from motionary.dictionary.dictionary import Dictionary
from motionary.errors import InputError
from motionary.motion import Motion
from motionary.systems.registry import MOTION_TO_TEXT, SEARCH, STYLIZE

_MOST_VARIANTS = 6
_CHANCE, _REFERENCE = "by chance", "of the reference"
_TITLE = 40  # letters above a figure
_NUDGE = 1e-4  # seconds, fewer than the scrubber shows: viser sends no value that has not changed
READY = "Ready."


class Panel:
    """The controls of one visitor.

    Jobs run one at a time for each visitor, in the shared workers; a sign says what is being done.
    """

    def __init__(self, client: Any, dictionary: Dictionary, workers: Workers, generators: Sequence[str]):
        self.client, self.dictionary, self.workers = client, dictionary, workers
        self.gui = client.gui
        self._busy, self._closed = threading.Lock(), False
        self._loaded: Motion | None = None
        self._reference: Motion | None = None
        self._rows: list[Any] = []
        self.status = self.gui.add_markdown(READY)
        tabs = self.gui.add_tab_group()
        if generators:
            with tabs.add_tab("Generate"):
                self._generate_tab(generators)
        with tabs.add_tab("Read"):
            self._read_tab(bool(dictionary.offering(MOTION_TO_TEXT)), bool(dictionary.offering(STYLIZE)))
        if dictionary.offering(SEARCH):
            with tabs.add_tab("Search"):
                self._search_tab()
        self._play_folder()
        self._files = self.gui.add_folder("Results")
        self.player = Player(client, self._told)

    def close(self) -> None:
        """Ends playback; jobs of this visitor that have not begun are dropped."""
        self._closed = True
        self.player.close()

    # Controls ----------------------------------------------------------------------------------------------------

    def _generate_tab(self, generators: Sequence[str]) -> None:
        gui = self.gui
        prompt = gui.add_text("Prompt", "a person waves with the left hand")
        system = gui.add_dropdown("System", tuple(generators))
        count = gui.add_slider("Variants", min=1, max=_MOST_VARIANTS, step=1, initial_value=1)
        seed = gui.add_number("Seed", 0, min=0, max=2**31 - 1, step=1)
        seconds = gui.add_slider("Seconds", min=0.0, max=9.8, step=0.2, initial_value=0.0, hint="0: the system decides")
        button = gui.add_button("Generate")

        def work() -> None:
            """Generates and shows."""
            text, length = prompt.value, float(seconds.value) or None
            motions = self.dictionary.generate(text, int(count.value), length, system.value, int(seed.value))
            words = self.dictionary.read_as(text)
            titles = [text if len(motions) == 1 else f"{k + 1}. {text}" for k in range(len(motions))]
            self._show(motions, titles, [text] * len(motions), f"Read as: {words}")

        button.on_click(lambda _: self._start("Making motions", work))

    def _read_tab(self, captions: bool, styles: bool) -> None:
        gui = self.gui
        kinds = ", ".join(name.lstrip(".").upper() for name in READABLE)
        upload = gui.add_upload_button(f"Upload a motion ({kinds})", mime_type=",".join(READABLE))
        said = gui.add_markdown("")

        def work() -> None:
            """Reads the upload, shows it and lists its captions."""
            file = upload.value
            self._loaded = motion = self.workers.in_process(read_upload, file.name, file.content)
            self._show([motion], [file.name], [""], f"{_plain(file.name)}: {motion.duration:.1f} s")
            said.content = ""
            if captions:
                found = self.dictionary.caption(motion, n=3)
                said.content = "**Captions**\n\n" + "\n".join(f"- {_plain(text)}" for text in found)

        upload.on_upload(lambda _: self._start("Reading the motion", work))
        if styles:
            self._style_controls()

    def _style_controls(self) -> None:
        gui = self.gui
        with gui.add_folder("Stylize"):
            style = gui.add_dropdown("Style", (_CHANCE, _REFERENCE))
            reference = gui.add_upload_button("Upload a reference", mime_type=",".join(READABLE))
            strength = gui.add_slider("Strength", min=0.0, max=1.5, step=0.05, initial_value=1.0)
            seed = gui.add_number("Style seed", 0, min=0, max=2**31 - 1, step=1)
            button = gui.add_button("Stylize")

        def labels() -> None:
            """Offers the known styles, once the models are open."""
            style.options = (_CHANCE, _REFERENCE, *self.dictionary.styles)

        def read_reference() -> None:
            """Keeps the uploaded motion as the reference."""
            file = reference.value
            self._reference = self.workers.in_process(read_upload, file.name, file.content)
            style.value = _REFERENCE
            self._say(f"Reference: {_plain(file.name)}")

        def work() -> None:
            """Stylizes what was read, or else what is shown first, and shows both."""
            content = self._loaded or next((item.motion for item in self.player.items), None)
            if content is None:
                raise InputError("motion", "none", "upload or generate one first")
            chosen: dict[str, Any] = {}
            if style.value == _REFERENCE:
                if self._reference is None:
                    raise InputError("reference", "none", "upload one first")
                chosen["reference"] = self._reference
            elif style.value != _CHANCE:
                chosen["style"] = style.value
            options = {"seed": int(seed.value), "strength": float(strength.value)}
            (result,) = self.dictionary.stylize(content, **chosen, **options)
            title = f"style {style.value}"
            said = f"Stylized: {style.value}, strength {strength.value:g}, seed {seed.value}"
            self._show([content, result], ["before", title], ["before", title], _plain(said))

        self.workers.submit(lambda: self._guarded(labels))
        reference.on_upload(lambda _: self._start("Reading the reference", read_reference))
        button.on_click(lambda _: self._start("Stylizing", work))

    def _search_tab(self) -> None:
        gui = self.gui
        query = gui.add_text("Look for", "a person jumps")
        count = gui.add_slider("Matches", min=1, max=_MOST_VARIANTS, step=1, initial_value=3)
        button = gui.add_button("Search")
        listed = gui.add_markdown("")

        def work() -> None:
            """Searches, shows and lists."""
            matches = self.dictionary.search(query.value, int(count.value))
            names = [match.captions[0] if match.captions else match.id for match in matches]
            titles = [f"{k + 1}. {name}" for k, name in enumerate(names)]
            self._show([match.motion for match in matches], titles, names, f"{len(matches)} matches")
            rows = [
                f"{k + 1}. {_plain(n)} ({m.distance:.2f})" for k, (n, m) in enumerate(zip(names, matches, strict=True))
            ]
            listed.content = "\n".join(rows)

        button.on_click(lambda _: self._start("Searching", work))

    def _play_folder(self) -> None:
        gui = self.gui
        with gui.add_folder("Play"):
            self._clock = gui.add_slider("Time", min=0.0, max=10.0, step=0.01, initial_value=0.0)
            playing = gui.add_checkbox("Playing", True)
            speed = gui.add_slider("Speed", min=0.1, max=2.0, step=0.1, initial_value=1.0)
            look = gui.add_dropdown("Look", LOOKS)
            camera = gui.add_button("Reset the camera")

        async def seek(event: Any) -> None:  # in viser's loop, before the clock can overwrite what was sent
            """Stops where the visitor puts the scrubber."""
            if event.client is None:
                return  # moved by the clock
            seconds = float(self._clock.value)
            if self.player.playing:
                playing.value = self.player.playing = False
                # Shown anew: the clock's last report may reach the page after the visitor's own.
                self._clock.value = abs(seconds - _NUDGE)
            self.player.seek(seconds)

        self._clock.on_update(seek)
        playing.on_update(lambda _: setattr(self.player, "playing", bool(playing.value)))
        speed.on_update(lambda _: setattr(self.player, "speed", float(speed.value)))
        look.on_update(lambda _: self._start("Dressing", lambda: self.player.set_look(look.value)))
        camera.on_click(lambda _: self.player.look_at_all())

    # Work --------------------------------------------------------------------------------------------------------

    def _start(self, sign: str, job: Callable[[], None]) -> None:
        """Runs a job in the workers unless this visitor has one running; the page answers meanwhile."""
        if not self._busy.acquire(blocking=False):
            self._complain("One thing at a time", "What you asked before is still being done.")
            return

        def run() -> None:
            """The job, then readiness for the next."""
            try:
                self._guarded(job)
            finally:
                if self.status.content.startswith("⏳"):
                    self.status.content = READY
                self._busy.release()

        self.status.content = f"⏳ {sign} ..."
        if not self.workers.submit(run):
            self.status.content = READY
            self._busy.release()
            self._complain("Too many visitors", "Please try again in a minute.")

    def _guarded(self, job: Callable[[], None]) -> None:
        """A visitor's mistake becomes one line on the page; anything else is logged, and told without details."""
        if self._closed:
            return
        try:
            job()
        except InputError as error:
            self._complain("That does not work", str(error))
        except Exception:
            if not self._closed:
                traceback.print_exc()
                self._complain("Something went wrong", "The server's log says what.")

    def _say(self, text: str) -> None:
        self.status.content = text

    def _complain(self, title: str, text: str) -> None:
        self.client.add_notification(title, text[:500], color="red", auto_close_seconds=10.0)

    def _told(self, seconds: float) -> None:
        self._clock.value = min(round(seconds, 2), float(self._clock.max))

    def _show(self, motions: Sequence[Motion], titles: Sequence[str], captions: Sequence[str], said: str) -> None:
        short = [title if len(title) <= _TITLE else title[: _TITLE - 3] + "..." for title in titles]
        self.player.show([Item(motion, title) for motion, title in zip(motions, short, strict=True)])
        self._clock.max = max(round(self.player.duration, 2), 0.01)
        for row in self._rows:
            row.remove()
        self._rows = []
        with self._files:
            for motion, title, caption in zip(motions, short, captions, strict=True):
                self._row(motion, title, caption)
        self._say(said)

    def _row(self, motion: Motion, title: str, caption: str) -> None:
        label = self.gui.add_markdown(_plain(title))
        buttons = self.gui.add_button_group("Download", [name.lstrip(".") for name in WRITABLE])
        self._rows += [label, buttons]

        def work() -> None:
            """Writes the file and hands it to the browser."""
            extension = f".{buttons.value}"
            content = self.workers.in_process(file_bytes, motion, extension, caption)
            self.client.send_file_download(_file_name(title) + extension, content, save_immediately=True)

        buttons.on_click(lambda _: self._start("Writing the file", work))


def _plain(text: str) -> str:
    """Text that markdown shows as it is."""
    return re.sub(r"([\\`*_{}\[\]<>()#+!|~-])", r"\\\1", " ".join(text.split()))


def _file_name(title: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-") or "motion"
