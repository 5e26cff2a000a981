"""The tables of captions: against normalized and raw references, judged with their motions, and beside a reader."""

from __future__ import annotations

from typing import Any

from motionary.report.results import Results, at, with_variants
from motionary.report.table import NONE, Table, percent, show
from motionary.report.verdicts import judges_of

WORDED = (
    ("BLEU-1", "bleu1"),
    ("BLEU-4", "bleu4"),
    ("ROUGE-L", "rouge_l"),
    ("CIDEr", "cider"),
    ("BERTScore", "bert_score"),
)
JUDGED = (("R@1", "r1"), ("R@3", "r3"), ("MM distance", "mm_dist"))


def motion_to_text(results: Results, part: str = "all") -> Table | None:
    """Captions against the references, and judged with the motions they describe."""
    systems = {n: r for n, r in with_variants(results.having("language"), "consensus").items() if part in r["language"]}
    if not systems:
        return None
    first = next(iter(systems.values()))
    real = first.get("caption_real", first.get("real"))
    others = judges_of(results)
    columns = ["", *(h for h, _ in WORDED), "BLEU-4, raw captions", *(h for h, _ in JUDGED)]
    columns += [*(f"R@3 by {judge}" for judge in others), "names the action"]

    def found(rows: Any) -> list[str]:
        """How well the motions find their captions, by each judge."""
        row = at(rows, part)
        return [*(show(at(row, key)) for _, key in JUDGED), *(show(at(row, "by", judge, "r3")) for judge in others)]

    rows = [["real captions", *[NONE] * 6, *found(real), NONE]]
    for name, report in systems.items():
        words = report["language"][part]
        scores = [show(words.get(key)) for _, key in WORDED] + [show(at(words, "raw", "bleu4"))]
        rows.append([name, *scores, *found(report.get("captioning")), percent(at(report, "action", part, "named"))])
    words = first["language"][part]
    model = f"; BERTScore by {words['bert_model']}" if words.get("bert_model") else ""
    note = (
        f"{words['items']} test motions; scores on normalized captions{model}; ± is the 95% interval, of these scores"
        " over captions, of R-precision over repetitions."
    )
    return Table("Motion to text" if part == "all" else f"Motion to text: {part}", columns, rows, note)


def raw_captions(results: Results) -> Table | None:
    """Captions scored against the references as people wrote them: letters, tense and plurals count."""
    systems = {
        name: report
        for name, report in with_variants(results.having("language"), "consensus").items()
        if at(report, "language", "all", "raw")
    }
    columns = [(heading, key) for heading, key in WORDED if key != "bert_score"]
    rows = [
        [name, *(show(at(report, "language", "all", "raw", key)) for _, key in columns)]
        for name, report in systems.items()
    ]
    note = (
        "Scores against the captions as they were written, with inflected words; ± is the 95% interval over captions."
    )
    return (
        Table("Motion to text: raw captions", ["", *(heading for heading, _ in columns)], rows, note) if rows else None
    )


def captions_by_labels(results: Results) -> Table | None:
    """Captions of windows with known style and action beside those of a reader who knows both."""
    systems = {
        n: r["labels"] for n, r in with_variants(results.having("language"), "consensus").items() if r.get("labels")
    }
    if not systems:
        return None
    first = next(iter(systems.values()))
    rows = [["a reader who knows both", show(at(first, "seen", "reader")), percent(1.0), NONE]]
    for name, labels in systems.items():
        seen, said = show(at(labels, "seen", "bleu4")), percent(at(labels, "seen", "said"))
        rows.append([name, seen, said, show(at(labels, "unseen", "bleu4"))])
    seen, unseen = (at(first, part, "items") or 0 for part in ("seen", "unseen"))
    note = (
        f"{seen} test motions with a style and an action that training saw together, {unseen} with two that it did not."
        " The reader says the training caption for both that agrees best with the others; said: one of those captions."
    )
    return Table("Captions and labels", ["", "BLEU-4, seen", "said", "BLEU-4, unseen"], rows, note)
