"""The report as one self-contained HTML page."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

from motionary.motion import Motion
from motionary.report import caption_tables, tables
from motionary.report.action_tables import action_tables
from motionary.report.copy_tables import copies
from motionary.report.corpus_table import corpus_tables
from motionary.report.headline import headline, systems_html
from motionary.report.physics_tables import physics_tables
from motionary.report.players import Example, motions_html
from motionary.report.position_tables import position_tables
from motionary.report.results import Results
from motionary.report.style_tables import classifiers_table, stylization_tables
from motionary.report.table import NONE, Table
from motionary.report.verdicts import verdicts_table

LEAD = (
    "Sentences turned into motion, motion into sentences, and one style into another, by systems that learned from one "
    "corpus and are judged on test clips that none of them saw."
)
TERMS = {
    "R@k": "share of motions whose own caption is among the k nearest of a pool of captions; higher is better.",
    "FID": "distance between the distributions of generated and real motions in the evaluator's space; lower is "
    "better. Two halves of the real motions have a distance too: nothing can be told apart below it.",
    "MM distance": "mean distance between a motion and its caption in the evaluator's space; lower is better.",
    "Diversity": "mean distance between two motions of different captions; near the real motions' is better.",
    "Multimodality": "mean distance between two motions generated for one caption.",
    "Oracle": "share of motions that do what their text claims of side, direction, speed or action, read off the "
    "joints by geometry, without any trained model.",
    "Foot skating": "mean speed over the ground of feet that stand; lower is better.",
    "Penetration, floating, jerk, bone change": "how far joints sink below the floor, how often none is near it, how "
    "abruptly joints move, and by how much bones change their lengths; near the real motions' is better.",
    "Style and content accuracy": "share of motions in which a classifier sees the style that was asked for, or the "
    "action of the content; a copied content is the floor of the one and the ceiling of the other.",
    "Geodesic distance": "mean angle between the joints' local rotations before and after stylization: how much of the "
    "content's own movement is kept.",
    "BLEU, ROUGE-L, CIDEr, BERTScore": "agreement of a generated caption with the references; higher is better.",
}
PICTURES = {
    "contexts": "The most frequent motion tokens, each decoded alone to its four frames, light to dark. A quarter "
    "view: forward runs to the right. In the title: the token and its share of all tokens.",
    "style_codes": "Style codes of real motions in two dimensions (t-SNE). Without labels a code tells the style; "
    "beside a label it tells what else there is, so that the colors should mix.",
    "one_motion_many_styles": "One motion above what stylization makes of it; time runs to the right.",
    "actions": "One motion of each of the most frequent actions; time runs to the right.",
    "transitions": "Where the label changes in the middle of a motion.",
    "outpainting": "A real motion, and three motions that go on from its first quarter.",
    "interpolation": "Motions whose first latent lies between those of two seeds.",
    "densities": "How likely each length is, given the text above it; dark: the lengths of the motions so described.",
}

ACTED = ("actions", "transitions", "outpainting", "interpolation")
STYLED = ("style_codes", "one_motion_many_styles")


def render(
    results: Results,
    corpus: Mapping[str, Any] | None = None,
    examples: Sequence[Example] = (),
    problems: Sequence[str] = (),
    styled: Sequence[tuple[str, Motion]] = (),
    facts: Mapping[str, str] | None = None,
) -> str:
    """The page: motions that play, one table, and folded below them all the rest.

    Args:
        results: of every stage.
        corpus: the preprocess stage's report.
        examples: captions with real and generated motions.
        problems: one line on each system that is not shown.
        styled: a motion and the same in other styles, each with a name.
        facts: what the run was, by name: corpus, scale, commit, date.
    """
    motions = motions_html(examples, styled) + "".join(f"<p class='note'>Not shown: {escape(p)}</p>" for p in problems)
    first = [("Motions", motions), ("Results", _main(results))]
    folded = [
        ("All results", _results(results)),
        ("Captions", _captions(results)),
        ("Parts of the test split", _tables(tables.parts_tables(results))),
        ("Physics", _tables(physics_tables(results))),
        ("Joint positions", _tables(position_tables(results))),
        ("Prompts", _tables([tables.prompts(results)])),
        ("Stylization", _stylization(results)),
        ("Actions", _actions(results)),
        ("Training", _tables([tables.training(results)]) + _curves(results)),
        ("Pictures", _pictures(results)),
        ("Corpus", "".join(map(_corpus_table, corpus_tables(corpus))) if corpus else ""),
        ("How to read the numbers", _terms()),
    ]
    shown = [(title, text) for title, text in (*first, *folded) if text]
    links = "".join(f"<a href='#{_anchor(title)}'>{escape(title)}</a>" for title, _ in shown)
    body = "\n".join(_section(title, text, (title, text) in folded) for title, text in shown)
    template = Template(files("motionary.report").joinpath("page.html").read_text(encoding="utf-8"))
    evaluators = escape(", ".join(results.evaluators) or "none yet")
    told = " · ".join(f"<b>{escape(key)}</b> {escape(value)}" for key, value in (facts or {}).items())
    return template.substitute(lead=escape(LEAD), facts=told, links=links, body=body, evaluators=evaluators)


def _section(title: str, text: str, folded: bool) -> str:
    heading = f"<h2 id='{_anchor(title)}'>{escape(title)}</h2>"
    if not folded:
        return f"{heading}\n{text}"
    return f"<details class='section'><summary>{heading}</summary>\n{text}</details>"


def _main(results: Results) -> str:
    """The one table, and what each system is."""
    table = headline(results)
    if table is None:
        return "<p>No system has been evaluated yet: run <code>dvc repro</code>.</p>"
    return table.html() + systems_html(results)


def _results(results: Results) -> str:
    return _tables(
        [
            tables.text_to_motion(results),
            *tables.by_other_judges(results),
            verdicts_table(results),
            caption_tables.motion_to_text(results),
            caption_tables.raw_captions(results),
            caption_tables.captions_by_labels(results),
            tables.reconstruction(results),
            tables.lengths(results),
            tables.nearest_training(results),
            copies(results),
        ]
    )


def _tables(found: Sequence[Table | None]) -> str:
    return "".join(table.html() for table in found if table is not None)


def _stylization(results: Results) -> str:
    found = stylization_tables(results)
    return _tables([*found, classifiers_table(results)]) + _pictures(results, STYLED) if found else ""


def _actions(results: Results) -> str:
    found = action_tables(results)
    return _tables(found) + _pictures(results, ACTED) if found else ""


def _corpus_table(table: Table) -> str:
    if table.title != "Problems":
        return table.html()
    return f"<details class='wide'><summary>Problems found in the sources</summary>{table.html()}</details>"


def _captions(results: Results) -> str:
    found = []
    for name, report in results.having("language").items():
        rows = [[e["caption"] or NONE, " / ".join(e["references"])] for e in report.get("examples", ())]
        if rows:
            found.append(f"<div class='wide'>{Table(name, ['generated', 'references'], rows).html()}</div>")
    return "".join(found)


def _curves(results: Results) -> str:
    curves = [(n, p) for n, paths in results.figures.items() for p in paths if p.stem.endswith("curves")]
    return "".join(_picture(path, f"{name}: {path.stem.replace('_', ' ')}") for name, path in curves)


def _pictures(results: Results, names: Sequence[str] = ()) -> str:
    """Pictures that are no curves: those of these names, or all that no section shows by name."""
    others = [(n, p) for n, paths in results.figures.items() for p in paths if not p.stem.endswith("curves")]
    kept = [(n, p) for n, p in others if (p.stem in names if names else p.stem not in STYLED + ACTED)]
    return "".join(_picture(p, f"{n}: {p.stem.replace('_', ' ')}", PICTURES.get(p.stem, "")) for n, p in kept)


def _picture(path: Path, title: str, note: str = "") -> str:
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    text = f"<p class='note'>{escape(note)}</p>" if note else ""
    alt = escape(title, quote=True)
    return f"<figure><h3>{escape(title)}</h3>{text}<img alt='{alt}' src='data:image/png;base64,{data}'></figure>\n"


def _terms() -> str:
    return "<dl>" + "".join(f"<dt>{escape(k)}</dt><dd>{escape(v)}</dd>" for k, v in TERMS.items()) + "</dl>"


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")
