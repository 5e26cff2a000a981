"""The page's controls for motions of action labels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from motionary.app import limits
from motionary.app.limits import among, within
from motionary.app.turns import Turns
from motionary.dictionary.dictionary import Dictionary

_THEN = "nothing else"


def build_act_tab(
    gui: Any,
    dictionary: Dictionary,
    turns: Turns,
    submit: Callable[[Callable[[], Any]], Any],
    show: Callable[..., None],
) -> None:
    """An action, what follows it, and of how large a body; the known actions are listed once the models are open."""
    first = gui.add_dropdown("Action", (_THEN,))
    then = gui.add_dropdown("Then", (_THEN,))
    count = gui.add_slider("Motions", min=1, max=limits.MOST_VARIANTS, step=1, initial_value=1)
    seconds = gui.add_slider("Seconds each", min=0.4, max=limits.MOST_GENERATED, step=0.2, initial_value=3.0)
    scale = gui.add_slider("Body", min=0.5, max=2.0, step=0.05, initial_value=1.0)
    seed = gui.add_number("Action seed", 0, min=0, max=limits.LARGEST_SEED, step=1)
    feet = gui.add_checkbox("Acted feet stand", True, hint=limits.FEET)
    button = gui.add_button("Act")

    def names() -> None:
        """Offers the known actions."""
        known = turns.on_models(lambda: dictionary.actions)
        first.options, then.options = known, (_THEN, *known)
        first.value = known[0]

    def work() -> None:
        """Makes the motions and shows them."""
        known = turns.on_models(lambda: dictionary.actions)
        actions = [among("action", first.value, known)]
        if then.value != _THEN:
            actions.append(among("then", then.value, known))
        n = int(within("motions", count.value, 1, limits.MOST_VARIANTS))
        length = within("seconds", seconds.value, 0.4, limits.MOST_GENERATED)
        start = int(within("seed", seed.value, 0, limits.LARGEST_SEED))
        size = within("body", scale.value, 0.5, 2.0)
        motions = turns.on_models(lambda: dictionary.act(actions, n, length, start, size, feet=bool(feet.value)))
        title = ", then ".join(actions)
        titles = [title if n == 1 else f"{k + 1}. {title}" for k in range(n)]
        show(motions, titles, [title] * n, f"{n} motions")

    submit(lambda: turns.guarded(names))
    button.on_click(lambda _: turns.start("Acting", work))
