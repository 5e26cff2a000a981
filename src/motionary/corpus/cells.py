"""What stylization may train on, and the combinations of style and action that it is tested on."""

from __future__ import annotations

import hashlib
from collections import Counter
from dataclasses import dataclass

import numpy as np

from motionary.corpus.store import Corpus
from motionary.errors import MOST, InputError, check_range, check_values

KEPT = 2  # other cells in which each style and each action of a held-out cell stays in training


@dataclass(frozen=True)
class StyleConfig:
    """The `styles` section of the configuration; see `style_split`."""

    held_out: float = 0.2
    scored_clips: int = 100

    def __post_init__(self) -> None:
        check_values("styles", self, ("held_out",), lambda v: 0 < v < 1, "must lie between 0 and 1")
        check_range("styles", self, ("scored_clips",), 1, MOST)


@dataclass(frozen=True, eq=False)
class StyleSplit:
    """A split of its own beside the corpus's, which goes by clip: whole (style, action) cells are held out.

    Attributes:
        styles, actions: label names; a label id is a position in them.
        scored: ids of the styles with enough clips to be scored; the others only train.
        cells: held-out (style id, action id) pairs.
        train: rows that anything may train on: of split "train", in no held-out cell and no copy of what is in one.
        labeled: those of `train` with a style label.
        validation: rows of split "val" in no held-out cell; `train` where there is none, as in small corpora, whose
            curves then show the training windows.
        labeled_validation: those with a style label; `labeled` where there is none.
        test: unmirrored rows of the held-out cells, of any split of the corpus: nothing is trained on them.
        references: unmirrored rows of split "test" of the scored styles, in no held-out cell: motions that nothing is
            trained on and that show a style as training does, clip by clip like the thesis's test set.
        unseen: unmirrored rows of split "test" without a style label: unseen content.
    """

    styles: tuple[str, ...]
    actions: tuple[str, ...]
    scored: tuple[int, ...]
    cells: tuple[tuple[int, int], ...]
    train: np.ndarray
    labeled: np.ndarray
    validation: np.ndarray
    labeled_validation: np.ndarray
    test: np.ndarray
    references: np.ndarray
    unseen: np.ndarray


def style_split(corpus: Corpus, held_out: float = 0.2, scored_clips: int = 100, seed: int = 0) -> StyleSplit:
    """Holds out about the share `held_out` of the cells of the scored styles, at least one of each.

    Each style and each action of a held-out cell stays in training in at least two other cells. Cells with less than
    a quarter of their style's clips per cell neither count nor are held out. The choice depends on names and seed.

    Args:
        held_out: share of cells, in (0, 1).
        scored_clips: a style is scored from this many source clips on.
        seed: another seed holds out other cells.

    Raises:
        InputError: a value is out of range, or a scored style has no cell that could be held out.
    """
    StyleConfig(held_out, scored_clips)
    styles, actions, clips = corpus.style_ids, corpus.action_ids, corpus.clips
    labeled = (styles >= 0) & ~clips.mirrored
    sources = {clips.origin[i]: (int(styles[i]), int(actions[i])) for i in np.flatnonzero(labeled)}
    clips_of = Counter(style for style, _ in sources.values())
    scored = tuple(sorted(style for style, count in clips_of.items() if count >= scored_clips))
    cells = _hold_out(corpus, _large_cells(Counter(sources.values()), scored), scored, held_out, seed)

    held = np.zeros((len(corpus.context.styles) + 1, len(corpus.context.actions) + 1), dtype=bool)
    for style, action in cells:
        held[style, action] = True
    inside = held[styles, actions]  # an unknown label, -1, reads the last row or column, which is empty
    test = inside & ~clips.mirrored
    # The mirrored copy of a held-out wave with the left hand is one with the right: its cell may train, but not it.
    inside |= np.isin(clips.origin, clips.origin[test])
    train, validation = ((clips.split == name) & ~inside for name in ("train", "val"))
    labeled_train, labeled_validation = train & (styles >= 0), validation & (styles >= 0)
    return StyleSplit(
        styles=corpus.context.styles,
        actions=corpus.context.actions,
        scored=scored,
        cells=cells,
        train=np.flatnonzero(train),
        labeled=np.flatnonzero(labeled_train),
        validation=np.flatnonzero(validation if validation.any() else train),
        labeled_validation=np.flatnonzero(labeled_validation if labeled_validation.any() else labeled_train),
        test=np.flatnonzero(test),
        references=np.flatnonzero((clips.split == "test") & ~inside & np.isin(styles, scored) & ~clips.mirrored),
        unseen=np.flatnonzero((clips.split == "test") & (styles < 0) & ~clips.mirrored),
    )


def _large_cells(counts: Counter[tuple[int, int]], scored: tuple[int, ...]) -> set[tuple[int, int]]:
    """Cells of the scored styles that hold at least a quarter of their style's clips per cell."""
    large = set()
    for style in scored:
        own = {cell: count for cell, count in counts.items() if cell[0] == style and cell[1] >= 0}
        large |= {cell for cell, count in own.items() if 4 * count * len(own) >= sum(own.values())}
    return large


def _hold_out(
    corpus: Corpus, cells: set[tuple[int, int]], scored: tuple[int, ...], share: float, seed: int
) -> tuple[tuple[int, int], ...]:
    """A cell of each style in turn, in an order drawn from the seed, until there are enough."""
    names, acts = corpus.context.styles, corpus.context.actions
    order = sorted(cells, key=lambda cell: _draw(seed, names[cell[0]], acts[cell[1]]))
    of_style, of_action = Counter(style for style, _ in cells), Counter(action for _, action in cells)
    wanted = max(len(scored), round(share * len(cells)))
    held: list[tuple[int, int]] = []
    while len(held) < wanted:
        before = len(held)
        for style in scored:
            free = (c for c in order if c[0] == style and c not in held and of_action[c[1]] > KEPT)
            cell = next(free, None) if of_style[style] > KEPT and len(held) < wanted else None
            if cell is not None:
                held.append(cell)
                of_style[style] -= 1
                of_action[cell[1]] -= 1
            elif style not in {s for s, _ in held}:
                rule = f"needs an action to hold out: it and the action must each stay in {KEPT} other combinations"
                raise InputError("style", names[style], rule)
        if len(held) == before:
            break
    return tuple(sorted(held))


def _draw(seed: int, *names: str) -> str:
    return hashlib.sha256(":".join((str(seed), *names)).encode()).hexdigest()
