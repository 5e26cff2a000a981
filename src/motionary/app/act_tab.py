"""The page's controls for motions of action labels."""

from __future__ import annotations

from motionary.app import limits
from motionary.app.limits import among, within
from motionary.app.player import Item
from motionary.app.visit import Visit
from motionary.app.wording import plain, titles

_THEN = "nothing else"


def build_act_tab(visit: Visit) -> None:
    """Controls for an action, those that follow it, and the body's size; they list what the opened models know."""
    gui, turns, dictionary = visit.gui, visit.turns, visit.dictionary
    first = gui.add_dropdown("Action", (_THEN,))
    then = gui.add_dropdown("Then", (_THEN,))
    after = gui.add_checkbox("Go on from what is shown", False)
    menu = visit.menu("Go on from")
    count = gui.add_slider("Motions", min=1, max=limits.MOST_VARIANTS, step=1, initial_value=1)
    seconds = gui.add_slider("Seconds each", min=0.4, max=limits.MOST_GENERATED, step=0.2, initial_value=3.0)
    scale = gui.add_slider("Body", min=0.5, max=2.0, step=0.05, initial_value=1.0)
    seed = visit.seed("Action seed")
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
        size, begin = within("body", scale.value, 0.5, 2.0), visit.seeded(seed)
        start = visit.chosen(menu).motion if after.value else None
        motions = turns.on_models(lambda: dictionary.act(actions, n, length, begin, size, start, bool(feet.value)))
        text = ", then ".join(actions)
        items = [Item(motion, title, text) for motion, title in zip(motions, titles([text] * n), strict=True)]
        visit.show(items, f"Acted: {plain(text)}")

    turns.submit(names)
    button.on_click(lambda _: turns.start("Acting", work))
