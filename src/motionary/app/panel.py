"""What one visitor sees and asks: prompts, uploads, searches, results, playback. Nothing here is shared but models."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from motionary.app import limits
from motionary.app.act_tab import build_act_tab
from motionary.app.figures import LOOKS
from motionary.app.limits import among, within
from motionary.app.player import Item, Player
from motionary.app.turns import Turns
from motionary.app.uploads import take
from motionary.app.work import READABLE, WRITABLE, Workers, file_bytes, read_upload
from motionary.dictionary.dictionary import Dictionary
from motionary.errors import InputError
from motionary.motion import Motion
from motionary.systems.registry import ACT, MOTION_TO_TEXT, SEARCH, STYLIZE

_CHANCE, _REFERENCE = "by chance", "of the reference"
_TITLE = 40  # letters above a figure
_NUDGE = 1e-4  # seconds, fewer than the scrubber shows: viser sends no value that has not changed


class Panel:
    """The controls of one visitor. What they ask for runs one at a time; see :class:`Turns`."""

    def __init__(self, client: Any, dictionary: Dictionary, workers: Workers, generators: Sequence[str]):
        self.client, self.dictionary, self.gui = client, dictionary, client.gui
        self._turns = Turns(client, workers)
        self._submit, self._start, self._say = workers.submit, self._turns.start, self._turns.say
        self._loaded: Motion | None = None
        self._reference: Motion | None = None
        self._rows: list[Any] = []
        tabs = self.gui.add_tab_group()
        if generators:
            with tabs.add_tab("Generate"):
                self._generate_tab(generators)
        if dictionary.offering(ACT):
            with tabs.add_tab("Act"):
                self._act_tab()
        with tabs.add_tab("Read"):
            self._read_tab(bool(dictionary.offering(MOTION_TO_TEXT)), bool(dictionary.offering(STYLIZE)))
        if dictionary.offering(SEARCH):
            with tabs.add_tab("Search"):
                self._search_tab()
        self._play_folder()
        self._files = self.gui.add_folder("Results")
        self.player = Player(client, self._told)

    def close(self) -> None:
        """Ends playback and what is being done for this visitor."""
        self._turns.close()
        self.player.close()

    # Controls ----------------------------------------------------------------------------------------------------

    def _generate_tab(self, generators: Sequence[str]) -> None:
        gui = self.gui
        prompt = gui.add_text("Prompt", "a person waves with the left hand")
        system = gui.add_dropdown("System", tuple(generators))
        count = gui.add_slider("Variants", min=1, max=limits.MOST_VARIANTS, step=1, initial_value=1)
        seed = gui.add_number("Seed", 0, min=0, max=limits.LARGEST_SEED, step=1)
        hint = "0: the system decides"
        seconds = gui.add_slider("Seconds", min=0.0, max=limits.MOST_GENERATED, step=0.2, initial_value=0.0, hint=hint)
        feet = gui.add_checkbox("Feet stand", True, hint=limits.FEET)
        button = gui.add_button("Generate")

        def work() -> None:
            """Generates and shows."""
            text, length = prompt.value, within("seconds", seconds.value, 0, limits.MOST_GENERATED) or None
            n = int(within("variants", count.value, 1, limits.MOST_VARIANTS))
            name = among("system", system.value, generators)
            start = int(within("seed", seed.value, 0, limits.LARGEST_SEED))
            motions = self._turns.on_models(self.dictionary.generate, text, n, length, name, start, bool(feet.value))
            words = self._turns.on_models(self.dictionary.read_as, text)
            titles = [text if len(motions) == 1 else f"{k + 1}. {text}" for k in range(len(motions))]
            self._show(motions, titles, [text] * len(motions), f"Read as: {words}")

        button.on_click(lambda _: self._start("Making motions", work))

    def _act_tab(self) -> None:
        build_act_tab(self.gui, self.dictionary, self._turns, self._submit, self._show)

    def _read_tab(self, captions: bool, styles: bool) -> None:
        gui = self.gui
        kinds = ", ".join(name.lstrip(".").upper() for name in READABLE)
        upload = gui.add_upload_button(f"Upload a motion ({kinds})", mime_type=",".join(READABLE))
        said = gui.add_markdown("")

        def work() -> None:
            """Reads the upload, shows it and lists its captions."""
            file = take(upload)
            self._loaded = motion = self._turns.in_process("read", read_upload, file.name, file.content)
            self._show([motion], [file.name], [""], f"{_plain(file.name)}: {motion.duration:.1f} s")
            said.content = ""
            if captions:
                found = self._turns.on_models(self.dictionary.caption, motion, 3)
                said.content = "**Captions**\n\n" + "\n".join(f"- {_plain(text)}" for text in found)

        upload.on_upload(lambda _: self._start("Reading the motion", work))
        if styles:
            self._style_controls()

    def _style_controls(self) -> None:
        gui = self.gui
        with gui.add_folder("Stylize"):
            style = gui.add_dropdown("Style", (_CHANCE, _REFERENCE))
            reference = gui.add_upload_button("Upload a reference", mime_type=",".join(READABLE))
            strength = gui.add_slider("Strength", min=0.0, max=limits.MOST_STRENGTH, step=0.05, initial_value=1.0)
            seed = gui.add_number("Style seed", 0, min=0, max=limits.LARGEST_SEED, step=1)
            feet = gui.add_checkbox("Stylized feet stand", True, hint=limits.FEET)
            button = gui.add_button("Stylize")

        def labels() -> None:
            """Offers the known styles, once the models are open."""
            styles = self._turns.on_models(lambda: self.dictionary.styles)
            style.options = (_CHANCE, _REFERENCE, *styles)

        def read_reference() -> None:
            """Keeps the uploaded motion as the reference."""
            file = take(reference)
            self._reference = self._turns.in_process("read", read_upload, file.name, file.content)
            style.value = _REFERENCE
            self._say(f"Reference: {_plain(file.name)}")

        def work() -> None:
            """Stylizes what was read, or else what is shown first, and shows both."""
            content = self._loaded or next((item.motion for item in self.player.items), None)
            if content is None:
                raise InputError("motion", "none", "upload or generate one first")
            chosen: dict[str, Any] = {"feet": bool(feet.value)}
            if style.value == _REFERENCE:
                if self._reference is None:
                    raise InputError("reference", "none", "upload one first")
                chosen["reference"] = self._reference
            elif style.value != _CHANCE:
                chosen["style"] = style.value
            chosen["seed"] = int(within("seed", seed.value, 0, limits.LARGEST_SEED))
            chosen["strength"] = within("strength", strength.value, 0, limits.MOST_STRENGTH)
            (result,) = self._turns.on_models(lambda: self.dictionary.stylize(content, **chosen))
            title = f"style {style.value}"
            said = f"Stylized: {style.value}, strength {strength.value:g}, seed {seed.value}"
            self._show([content, result], ["before", title], ["before", title], _plain(said))

        self._submit(lambda: self._turns.guarded(labels))
        reference.on_upload(lambda _: self._start("Reading the reference", read_reference))
        button.on_click(lambda _: self._start("Stylizing", work))

    def _search_tab(self) -> None:
        gui = self.gui
        query = gui.add_text("Look for", "a person jumps")
        count = gui.add_slider("Matches", min=1, max=limits.MOST_VARIANTS, step=1, initial_value=3)
        button = gui.add_button("Search")
        listed = gui.add_markdown("")

        def work() -> None:
            """Searches, shows and lists."""
            k = int(within("matches", count.value, 1, limits.MOST_VARIANTS))
            matches = self._turns.on_models(self.dictionary.search, query.value, k)
            names = [match.captions[0] if match.captions else match.id for match in matches]
            titles = [f"{k + 1}. {name}" for k, name in enumerate(names)]
            motions = [match.motion for match in matches if match.motion is not None]
            if len(motions) == len(matches):  # a bundle brings texts alone
                self._show(motions, titles, names, f"{len(matches)} matches")
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
            speed = gui.add_slider("Speed", min=limits.SPEEDS[0], max=limits.SPEEDS[1], step=0.1, initial_value=1.0)
            look = gui.add_dropdown("Look", LOOKS)
            camera = gui.add_button("Reset the camera")

        async def seek(event: Any) -> None:  # in viser's loop, before the clock can overwrite what was sent
            """Stops where the visitor puts the scrubber."""
            if event.client is None:
                return  # moved by the clock
            seconds = float(self._clock.value)
            ran, self.player.playing = self.player.playing, False
            self.player.seek(seconds)
            if ran:
                playing.value = False
                # Shown anew: the clock's last report may reach the page after the visitor's own.
                self._clock.value = abs(seconds - _NUDGE)

        self._clock.on_update(seek)
        playing.on_update(lambda _: setattr(self.player, "playing", bool(playing.value)))
        speed.on_update(lambda _: self.player.set_speed(float(speed.value)))
        look.on_update(lambda _: self._start("Dressing", lambda: self.player.set_look(look.value)))
        camera.on_click(lambda _: self.player.look_at_all())

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
        long = motion.duration > limits.MOST_VIDEO
        said = f"{motion.duration:.1f} s" + f"; mp4: the first {limits.MOST_VIDEO:.0f} s" * long
        label = self.gui.add_markdown(f"{_plain(title)} ({said})")
        buttons = self.gui.add_button_group("Download", [name.lstrip(".") for name in WRITABLE])
        self._rows += [label, buttons]

        def work() -> None:
            """Writes the file and hands it to the browser."""
            extension = among("file", f".{buttons.value}", WRITABLE)
            queue = "video" if extension == ".mp4" else "write"
            if queue == "video":
                self._say(f"⏳ Making a video of {min(motion.duration, limits.MOST_VIDEO):.1f} s ...")
            content = self._turns.in_process(queue, file_bytes, motion, extension, caption)
            self.client.send_file_download(_file_name(title) + extension, content, save_immediately=True)

        buttons.on_click(lambda _: self._start("Writing the file", work))


def _plain(text: str) -> str:
    """Text that markdown shows as it is."""
    return re.sub(r"([\\`*_{}\[\]<>()#+!|~-])", r"\\\1", " ".join(text.split()))


def _file_name(title: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-") or "motion"
