"""The page's controls for a search of the corpus."""

from __future__ import annotations

from motionary.app import limits
from motionary.app.limits import within
from motionary.app.player import Item
from motionary.app.visit import Visit
from motionary.app.wording import listed, titles


def build_search_tab(visit: Visit) -> None:
    """A sentence, and how many of the motions that lie nearest to it."""
    gui = visit.gui
    with (form := gui.add_form(None)):
        query = gui.add_text("Look for", "a person jumps")
    count = gui.add_slider("Matches", min=1, max=limits.MOST_VARIANTS, step=1, initial_value=3)
    button = gui.add_button("Search")
    only = gui.add_markdown("")

    def work() -> None:
        """Searches and shows."""
        k = int(within("matches", count.value, 1, limits.MOST_VARIANTS))
        matches = visit.turns.on_models(visit.dictionary.search, query.value, k)
        texts = [match.captions[0] if match.captions else match.id for match in matches]
        found = zip(matches, titles(texts), texts, strict=True)
        shown = [(match, title, text) for match, title, text in found if match.motion is not None]
        if shown:
            items = [Item(m.motion, title, text, f"distance {m.distance:.2f}") for m, title, text in shown]
            visit.show(items, f"{len(matches)} matches")
            only.content = ""
        else:  # a bundle brings texts alone
            only.content = listed(
                [f"{text} ({match.distance:.2f})" for match, text in zip(matches, texts, strict=True)]
            )

    for event in (form.on_submit, button.on_click):
        event(lambda _: visit.turns.start("Searching", work))
