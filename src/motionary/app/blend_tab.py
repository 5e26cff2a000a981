"""The page's controls for motions between two sentences."""

from __future__ import annotations

from motionary.app import limits
from motionary.app.limits import within
from motionary.app.player import Item
from motionary.app.visit import Visit
from motionary.app.wording import plain


def build_blend_tab(visit: Visit) -> None:
    """Two sentences, and how many motions from the one to the other."""
    gui = visit.gui
    with (form := gui.add_form(None)):
        first = gui.add_text("From", "a person walks")
        second = gui.add_text("To", "a person jumps")
    steps = gui.add_slider("Steps", min=2, max=limits.MOST_VARIANTS, step=1, initial_value=4)
    seconds = gui.add_slider("Length", min=1.0, max=limits.MOST_GENERATED, step=0.2, initial_value=4.0)
    seed = visit.seed("Blend seed")
    button = gui.add_button("Blend")

    def work() -> None:
        """Makes the motions and shows them."""
        count = int(within("steps", steps.value, 2, limits.MOST_VARIANTS))
        length, start = within("length", seconds.value, 1, limits.MOST_GENERATED), visit.seeded(seed)
        one, other = first.value, second.value
        motions = visit.turns.on_models(visit.dictionary.blend, one, other, count, length, start)
        shares = [round(100 * k / (count - 1)) for k in range(count)]
        texts = [one, *(f"{share}% from {one} to {other}" for share in shares[1:-1]), other]
        items = [Item(m, f"{share}%", text) for m, share, text in zip(motions, shares, texts, strict=True)]
        visit.show(items, f"From: {plain(one)}. To: {plain(other)}.")

    for event in (form.on_submit, button.on_click):
        event(lambda _: visit.turns.start("Blending", work))
