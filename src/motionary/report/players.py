"""Captions with their real motion beside what each generator makes of the same words, as players in the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np

from motionary.corpus.encoding import as_motion
from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.evaluation.items import Items, sentence_of
from motionary.formats.render.page import player_assets, player_fragment
from motionary.language import Sentence
from motionary.motion import Motion
from motionary.report.table import NONE
from motionary.systems.io import open_system
from motionary.systems.protocols import MotionToText, TextToMotion
from motionary.systems.registry import MOTION_TO_TEXT, TEXT_TO_MOTION, find


@dataclass(frozen=True)
class Example:
    """One caption of the test split.

    Attributes:
        caption: as written.
        part: the root that the real motion came from.
        motions: the real motion, then each generator's.
        labels: a name for each motion.
        captions: what each captioner says of the real motion, by its name.
    """

    caption: str
    part: str
    motions: Sequence[Motion]
    labels: Sequence[str]
    captions: Mapping[str, str]


def make_examples(
    corpus: Corpus, models: Path, systems: Sequence[str], count: int, seed: int = 0, device: str = "cpu"
) -> tuple[list[Example], list[str]]:
    """Examples of the test split, and one line on each system that could not be opened.

    Args:
        corpus: with captioned test windows.
        models: folder of trained systems.
        systems: names; each shows what it offers: generation, captions, both or nothing.
        count: at most this many examples.
        seed: of the generations.
        device: where the systems run.
    """
    try:
        items = Items(corpus)
    except InputError as error:
        return [], [str(error)]
    rows, captions = _choose(items, count)
    sentences = [sentence_of(corpus, caption) for caption in captions]
    real = [np.array(corpus.features(row)) for row in rows]
    generated: dict[str, list[Motion]] = {}
    said: dict[str, list[str]] = {}
    problems = []
    for name in systems:
        try:
            _ask(name, models, device, sentences, real, seed, generated, said)
        except InputError as error:
            problems.append(f"{name}: {error}")
    examples = []
    for i, sentence in enumerate(sentences):
        motions = [as_motion(real[i], corpus.context), *(motions[i] for motions in generated.values())]
        answers = {name: texts[i] for name, texts in said.items()}
        group = str(corpus.clips.group[rows[i]])
        examples.append(Example(sentence.text, group, motions, ["real", *generated], answers))
    return examples, problems


def _ask(
    name: str,
    models: Path,
    device: str,
    sentences: list[Sentence],
    real: list[np.ndarray],
    seed: int,
    generated: dict[str, list[Motion]],
    said: dict[str, list[str]],
) -> None:
    offers = find(name).offers
    if TEXT_TO_MOTION in offers:
        seeds = [seed + i for i in range(len(sentences))]
        generator: TextToMotion = open_system(name, TEXT_TO_MOTION, models, device)
        generated[name] = [as_motion(made, generator.context) for made in generator.generate(sentences, seeds)]
    if MOTION_TO_TEXT in offers:
        captioner: MotionToText = open_system(name, MOTION_TO_TEXT, models, device)
        said[name] = [texts[0] for texts in captioner.caption(real)]


def _choose(items: Items, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Corpus rows and caption rows: every root in turn, captions all different, spread evenly over the split."""
    corpus = items.corpus
    groups = corpus.clips.group[items.rows]
    captions = items.choose(0)
    shares = -(-count // len(np.unique(groups)))
    places: list[int] = []
    for group in np.unique(groups):
        seen: set[int] = set()
        inside = [
            p for p in np.flatnonzero(groups == group) if not _repeats(int(corpus.captions.key[captions[p]]), seen)
        ]
        places += [inside[k] for k in np.unique(np.linspace(0, len(inside) - 1, shares).astype(int))]
    chosen = np.array(places[:count], int)
    return items.rows[chosen], captions[chosen]


def _repeats(key: int, seen: set[int]) -> bool:
    known = key in seen
    seen.add(key)
    return known


def motions_html(examples: Sequence[Example], styled: Sequence[tuple[str, Motion]] = ()) -> str:
    """Players of the first caption and of the styles, and folded those of the other captions; nothing is fetched."""
    if not examples and not styled:
        return ""
    shown = "".join(map(_player, examples[:1]))
    if styled:
        shown += f"<section class='example'><h3>One motion in other styles</h3>{player_fragment(styled)}</section>"
    others = "\n".join(map(_player, examples[1:]))
    folded = f"<details><summary>{len(examples) - 1} more</summary>{others}</details>" if others else ""
    return player_assets() + shown + folded


def _player(example: Example) -> str:
    player = player_fragment(list(zip(example.labels, example.motions, strict=True)))
    said = "".join(f"<li><b>{escape(n)}</b> says: {escape(text) or NONE}</li>" for n, text in example.captions.items())
    return (
        f"<section class='example'><h3>“{escape(example.caption)}”</h3>"
        + player
        + (f"<ul>{said}</ul>" if said else "")
        + f"<p class='note'>from {escape(example.part)}</p></section>"
    )
