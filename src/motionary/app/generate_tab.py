"""The page's controls for motions of a sentence."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from motionary.app import limits
from motionary.app.limits import among, within
from motionary.app.player import Item
from motionary.app.shown_poses import read_poses
from motionary.app.visit import Visit
from motionary.app.wording import plain, short, titles
from motionary.errors import InputError
from motionary.language import PromptReading, prompt_parts
from motionary.motion import Motion
from motionary.motion.paths import read_points
from motionary.systems.registry import find


class GenerateTab:
    """A prompt, three to try, and folded away how it is answered. Enter generates."""

    def __init__(self, visit: Visit, generators: Sequence[str], prompts: Sequence[str]):
        """
        Args:
            visit: the visitor's.
            generators: names of the systems that answer, the usual one first.
            prompts: sentences to try.
        """
        self._visit, self._generators, gui = visit, tuple(generators), visit.gui
        with (form := gui.add_form(None)):
            self._prompt = gui.add_text("Prompt", prompts[0])
        button = gui.add_button("Generate")
        self._tries = gui.add_button_group("Try", prompts)
        self._count = gui.add_slider("Variants", min=1, max=limits.MOST_VARIANTS, step=1, initial_value=1)
        with gui.add_folder("How", expand_by_default=False):
            self._system = gui.add_dropdown("System", self._generators)
            self._about = gui.add_markdown(plain(find(generators[0]).about))
            hint = "0: the system decides"
            self._seconds = gui.add_slider(
                "Seconds", min=0.0, max=limits.MOST_GENERATED, step=0.2, initial_value=0.0, hint=hint
            )
            self._seed = visit.seed()
            self._feet = gui.add_checkbox("Feet stand", True, hint=limits.FEET)
            self._then = gui.add_text("Then", "", hint="sentences that the motion goes on with, between semicolons")
            self._loop = gui.add_checkbox("Loop", False, hint="it ends as it begins")
            hint = "points of the ground to go along, in metres: 0,0 0,2 2,3 (x to the left, z ahead)"
            self._path = gui.add_text("Path", "", hint=hint)
            hint = "poses of what is shown to go through: 2=1@0.5 is, at 2 s, that of motion 1 at its second 0.5"
            self._poses = gui.add_text("Poses", "", hint=hint)
        self._system.on_update(lambda _: self._tell())
        form.on_submit(lambda _: self._start())
        button.on_click(lambda _: self._start())
        self._tries.on_click(lambda _: self._try())

    def suggest(self, prompts: Sequence[str]) -> None:
        """Offers other sentences to try."""
        if self._prompt.value == self._tries.options[0]:
            self._prompt.value = prompts[0]
        self._tries.options = tuple(prompts)

    def _try(self) -> None:
        self._prompt.value = among("try", self._tries.value, self._tries.options)
        self._start()

    def _tell(self) -> None:
        if self._system.value in self._generators:
            self._about.content = plain(find(self._system.value).about)

    def _start(self) -> None:
        self._visit.turns.start("Making motions", self._work)

    def _work(self) -> None:
        """Generates and shows."""
        visit, texts = self._visit, self._texts()
        length = within("seconds", self._seconds.value, 0, limits.MOST_GENERATED) or None
        n = int(within("variants", self._count.value, 1, limits.MOST_VARIANTS))
        name, seed = among("system", self._system.value, self._generators), visit.seeded(self._seed)
        feet = bool(self._feet.value)
        path = read_points(short(str(self._path.value), limits.MOST_LETTERS)) or None
        poses = read_poses(short(str(self._poses.value), limits.MOST_LETTERS), visit.items) or None
        how = {"join": len(texts) > 1, "loop": bool(self._loop.value), "path": path, "keyframes": poses}
        asked = partial(visit.dictionary.generate, **how)
        motions = visit.turns.on_models(asked, texts if len(texts) > 1 else texts[0], n, length, name, seed, feet)
        lines = [read_line(visit.turns.on_models(visit.dictionary.reading, text)) for text in texts]
        visit.show(of_one_text(motions, ", then ".join(texts)), "  \n".join(lines))

    def _texts(self) -> list[str]:
        """The prompt and what follows it; InputError where that is more than one motion can hold."""
        more = [text.strip() for text in str(self._then.value).split(";") if text.strip()]
        if len(more) > limits.MOST_FOLLOWING:
            raise InputError("then", f"{len(more)} sentences", f"must be at most {limits.MOST_FOLLOWING}")
        return [self._prompt.value, *more]


def read_line(reading: PromptReading) -> str:
    """How a prompt was read, as markdown that shows it letter by letter."""
    lines = [reading.line] if reading.line else []
    if len(prompt_parts(reading.sentence.text)) > 1:
        lines.append("A part may be lost: what follows has a field of its own, under How.")
    return "  \n".join([f"Read as: {plain(reading.words)}", *map(plain, lines)])


def of_one_text(motions: Sequence[Motion], text: str) -> list[Item]:
    """Motions that one text describes."""
    return [Item(motion, title, text) for motion, title in zip(motions, titles([text] * len(motions)), strict=True)]
