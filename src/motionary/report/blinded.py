"""A page on which people compare two systems' motions without knowing whose they are (TEMOS Fig. 3, appendix C).

    python -m motionary.report.blinded --a temos --b real --question realism --out realism.html

It is one HTML file that needs no network: give it to people, collect the JSON files that it lets them save, and read
them with :mod:`motionary.report.votes`. "real" stands for the recorded motions; any two systems that make motions of
text can be put on it. The order of pairs and their sides are drawn anew for each visitor. A few warm-ups come first and
do not count; catch trials, whose answer is plain, tell who did not look.
"""

from __future__ import annotations

import argparse
import base64
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from string import Template

import numpy as np

from motionary.corpus.encoding import as_motion
from motionary.corpus.store import Corpus
from motionary.errors import InputError, check_whole, exit_code
from motionary.evaluation.items import Items
from motionary.files import write_bytes
from motionary.formats.render.page import player_assets, player_fragment
from motionary.motion import Motion
from motionary.systems.io import choose_device, open_system
from motionary.systems.protocols import TextToMotion
from motionary.systems.registry import TEXT_TO_MOTION
from motionary.whole import check_output

REAL = "real"
QUESTIONS: Mapping[str, tuple[str, bool]] = {  # the question, and whether the text is shown
    "semantics": ("Which motion corresponds better to the textual description?", True),
    "realism": ("Which motion is more realistic?", False),
}
SHAKEN = 0.08  # metres by which every joint of a catch trial of realism jumps about


@dataclass(frozen=True)
class Comparison:
    """Two motions of one text. `kind` is "pair", "warm-up" or "catch"; the answer to a catch is `a`."""

    text: str
    a: Motion
    b: Motion
    kind: str = "pair"


def blinded_page(
    comparisons: Sequence[Comparison], a: str, b: str, question: str = "semantics", shows_text: bool | None = None
) -> str:
    """The page as HTML.

    Args:
        comparisons: in any order.
        a, b: names of the two sides, which only the saved answers say.
        question: a key of QUESTIONS, or a question of your own.
        shows_text: whether the text stands above the motions; None: as the question has it, else yes.

    Raises:
        InputError: no pair that counts, or a question that is empty.
    """
    if not any(comparison.kind == "pair" for comparison in comparisons):
        raise InputError("comparisons", len(comparisons), "must hold a pair that counts")
    if not question.strip():
        raise InputError("question", repr(question), f"must be {', '.join(QUESTIONS)} or a question of your own")
    asked, with_text = QUESTIONS.get(question, (question, True))
    with_text = with_text if shows_text is None else shows_text
    trials = [{"kind": c.kind, "text": c.text if with_text else "", "id": i} for i, c in enumerate(comparisons)]
    study = {"question": asked, "a": a, "b": b, "trials": trials}
    # Packed, so that a look at the source does not tell whose motions these are.
    data = base64.b64encode(json.dumps(study).encode()).decode()
    players = [f"<section hidden>{player_fragment([('', c.a), ('', c.b)])}</section>" for c in comparisons]
    folder = files("motionary.report")
    page = Template((folder / "blinded.html").read_text(encoding="utf-8"))
    script = (folder / "blinded.js").read_text(encoding="utf-8")
    return page.substitute(assets=player_assets(), players="".join(players), data=data, script=script)


def make_comparisons(
    items: Items, models: Path, a: str, b: str, question: str = "semantics", count: int = 20, warm_ups: int = 3,
    catches: int = 2, seed: int = 0, device: str = "auto",
) -> list[Comparison]:  # fmt: skip
    """Pairs of test texts drawn at random, each with the real duration where a system takes one.

    Raises:
        InputError: a system that makes no motions of text or is not there, too few test texts.
    """
    for name, value, least in (("count", count, 1), ("warm_ups", warm_ups, 0), ("catches", catches, 0)):
        check_whole(name, value, least)
    needed = count + warm_ups + catches
    if needed > len(items):
        raise InputError("texts", needed, f"warm-ups and catches included, must be at most the {len(items)} test texts")
    chosen = np.random.default_rng(seed).permutation(len(items))[:needed].tolist()
    compared, caught = chosen[: count + warm_ups], chosen[count + warm_ups :]
    sides = [_motions(name, items, compared, models, seed, device) for name in (a, b)]
    kinds = ["pair"] * count + ["warm-up"] * warm_ups
    texts = [items.references[i][0].text for i in compared]
    pairs = [Comparison(*found) for found in zip(texts, *sides, kinds, strict=True)]
    return pairs + [_catch(items, i, question, seed) for i in caught]


def _motions(name: str, items: Items, chosen: Sequence[int], models: Path, seed: int, device: str) -> list[Motion]:
    features, context = [items.features[i] for i in chosen], items.corpus.context
    if name == REAL:
        return items.motions(features)
    generator: TextToMotion = open_system(name, TEXT_TO_MOTION, models, choose_device(device))
    frames = [len(part) for part in features] if generator.takes_lengths else None
    sentences = [items.references[i][0] for i in chosen]
    made = generator.generate(sentences, [seed + i for i in range(len(chosen))], frames)
    return [as_motion(motion, context) for motion in made]


def _catch(items: Items, i: int, question: str, seed: int) -> Comparison:
    """The real motion beside one that is plainly worse: of a text with other words, or with joints that jump about."""
    (real,), sentence = items.motions([items.features[i]]), items.references[i][0]
    if question == "realism":
        noise = np.random.default_rng([seed, i]).normal(0, SHAKEN, real.positions.shape)
        return Comparison(sentence.text, real, Motion(real.positions + noise, real.fps, real.skeleton), "catch")
    shared = [len(set(sentence.words) & set(other[0].words)) for other in items.references]
    (other,) = items.motions([items.features[int(np.argmin(shared))]])
    return Comparison(sentence.text, real, other, "catch")


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes a page; exit code 2 and one line on bad input."""
    parser = argparse.ArgumentParser(prog="python -m motionary.report.blinded", description=__doc__)
    parser.add_argument("--a", required=True, help=f"a system, or {REAL}")
    parser.add_argument("--b", required=True, help="the other")
    parser.add_argument("--question", default="semantics", help=f"{', '.join(QUESTIONS)}, or one of your own")
    parser.add_argument("--texts", type=int, default=20, help="test texts that count (default 20)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--root", type=Path, default=Path(), help="the project, with models/ and data/corpus")
    out = Path("out/blinded.html")
    parser.add_argument("--out", type=Path, default=out, help=f"the page (default {out})")
    options = parser.parse_args(arguments)
    return exit_code(lambda: _write(options))


def _write(options: argparse.Namespace) -> None:
    items = Items(Corpus.open(check_output(options.root, "data/corpus")))
    names, asked = (options.a, options.b), options.question
    found = make_comparisons(items, options.root / "models", *names, asked, options.texts, seed=options.seed)
    print(write_bytes(options.out, blinded_page(found, *names, asked)))


if __name__ == "__main__":
    sys.exit(main())
