"""What one repetition of the stylization protocol asks for: contents, target styles, reference motions, seeds."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from motionary.corpus.cells import StyleSplit
from motionary.corpus.store import Corpus
from motionary.errors import InputError

HELD_OUT, TARGETS, UNLABELED = "held-out combinations", "held-out targets", "unlabeled contents"
TEST = "test motions"


@dataclass(frozen=True)
class Draw:
    """N contents and what is asked of each.

    Attributes:
        contents: (N,) rows of the corpus.
        actions: (N,) their action ids, -1 where unknown.
        targets: (N,) style ids, -1 where the corpus has no scored style.
        references: (N,) rows of motions of the target style, of clips that nothing was trained on.
        others: (M,) rows of further contents, for the distance of two sets of real motions; M may be 0.
        cells: (N,) rows of real motions of the target style and the content's own action, -1 where there is none.
        seeds: (N,) of the stylizer.
    """

    contents: np.ndarray
    actions: np.ndarray
    targets: np.ndarray
    references: np.ndarray
    others: np.ndarray
    cells: np.ndarray
    seeds: np.ndarray

    def take(self, where: np.ndarray) -> Draw:
        """The contents at positions `where`, with what is asked of them."""
        return replace(self, **{k: v[where] for k, v in vars(self).items() if k != "others"})


def pools(corpus: Corpus, split: StyleSplit) -> dict[str, np.ndarray]:
    """Rows that serve as contents, by part; nothing was trained on any of them.

    With scored styles: the motions of the held-out cells; the test split's labeled motions of other cells, to be asked
    for held-out combinations; the test split's motions without style label. Without: the test split.
    """
    test = np.flatnonzero((corpus.clips.split == "test") & ~corpus.clips.mirrored)
    if not split.scored:
        return {TEST: test}
    rest = np.setdiff1d(test[corpus.style_ids[test] >= 0], split.test)
    return {HELD_OUT: split.test, TARGETS: rest, UNLABELED: split.unseen}


class Drawer:
    """Draws repetitions from a pool of contents.

    Args:
        corpus: that holds all motions.
        split: its held-out cells and scored styles.
        pool: rows that serve as contents.
        receptive: frames that a reference needs at least.
        unseen: ask only for combinations of style and the content's action that were held out of training; contents
            for which there is none are left out of the pool.
    """

    def __init__(self, corpus: Corpus, split: StyleSplit, pool: np.ndarray, receptive: int = 1, unseen: bool = False):
        self.corpus, self.split, self.unseen = corpus, split, unseen
        long = corpus.clips.length >= receptive
        # Clips that nothing was trained on, of combinations that were; where a style has none, its held-out ones. A
        # style shown only by combinations that training never met would ask more of a reference than any user does.
        sources = (split.references, split.test) if split.scored else (np.asarray(pool),)
        self.references: dict[int, np.ndarray] = {}
        for style in split.scored or (-1,):
            of_style = [rows[long[rows] & ((corpus.style_ids[rows] == style) | (style < 0))] for rows in sources]
            found = next((rows for rows in of_style if len(rows)), None)
            if found is None:
                name = split.styles[style] if style >= 0 else "any"
                raise InputError("references", f"style {name}", f"no unseen motion lasts at least {receptive} frames")
            self.references[style] = found
        self.pool = np.array([row for row in pool if self._wanted(row)], dtype=np.int64)
        unmirrored = np.flatnonzero(~corpus.clips.mirrored & (corpus.style_ids >= 0))
        self.of_cell: dict[tuple[int, int], list[int]] = {}
        for row in unmirrored:
            self.of_cell.setdefault((int(corpus.style_ids[row]), int(corpus.action_ids[row])), []).append(int(row))

    def _wanted(self, row: int) -> list[int]:
        """The styles that may be asked of a content."""
        own, action = int(self.corpus.style_ids[row]), int(self.corpus.action_ids[row])
        others = [s for s in self.references if s != own or s < 0]
        return [s for s in others if (s, action) in self.split.cells] if self.unseen else others

    def draw(self, repetition: int, count: int, seed: int = 0) -> Draw:
        """Repetition number `repetition`: at most `count` contents without repetition; a target is any scored style
        but the content's own."""
        rng = np.random.default_rng([seed, repetition, 29])
        order = rng.permutation(self.pool)
        contents, others = order[:count], order[count : 2 * count]
        actions = self.corpus.action_ids[contents]
        targets = np.array([rng.choice(self._wanted(row)) for row in contents])
        pairs = [(int(s), int(a)) for s, a in zip(targets, actions, strict=True)]
        return Draw(
            contents=contents,
            actions=actions,
            targets=targets,
            references=np.array([rng.choice(self.references[s]) for s in targets.tolist()]),
            others=others,
            cells=np.array([rng.choice(self.of_cell[c]) if c[1] >= 0 and c in self.of_cell else -1 for c in pairs]),
            seeds=1_000_003 * (repetition + 1) + 4099 * seed + np.arange(len(contents)),
        )
