"""The tables of stylization: one for each kind of content, one of the classifiers that judge."""

from __future__ import annotations

from motionary.report.results import Results, at
from motionary.report.table import NONE, Table, percent, show

SCORED = (
    ("Style accuracy", "style_accuracy"),
    ("Style FID", "style_fid"),
    ("Content accuracy", "content_accuracy"),
    ("Content FID", "content_fid"),
    ("Geodesic distance, rad", "geodesic"),
    ("Diversity", "diversity"),
    ("Foot skating, m/s", "foot_skating"),
)
NOTES = {
    "held-out combinations": "Contents: real motions of combinations of style and action that nothing was trained on",
    "held-out targets": "Asked for: combinations of style and the content's action that nothing was trained on",
    "test motions": "Contents: real motions of the test split; no style has enough clips to be scored",
    "unlabeled contents": "Contents: real motions of clips without style label",
}


def stylization_tables(results: Results) -> list[Table]:
    """A table for each kind of content: real motions, floors and ceilings, then every way to stylize."""
    tables = []
    for report in results.stages.values():
        for part, found in (at(report, "style_transfer") or {}).items():
            rows = [[row, *(show(values.get(key)) for _, key in SCORED)] for row, values in found["rows"].items()]
            kept = [0, *(i for i in range(1, 1 + len(SCORED)) if any(row[i] != NONE for row in rows))]
            columns = ["", *(heading for heading, _ in SCORED)]
            styles = f" Style accuracy is the mean over {len(report['styles'])} styles." if report.get("styles") else ""
            note = (
                f"{found['items']} of {found['pool']} contents in each of {report['repetitions']} repetitions; ± is "
                f"the 95% interval. {NOTES.get(part, part)}.{styles} (S) learned with style labels, (U) without. "
                "Style FID: mean over the styles of the distance to real motions of each, of few motions and so not "
                "comparable with one over all. The real motions of the target cell may be of the classifiers' training."
            )
            rows = [[row[i] for i in kept] for row in rows]
            tables.append(Table(f"Stylization: {part}", [columns[i] for i in kept], rows, note))
    return tables


def classifiers_table(results: Results) -> Table | None:
    """What the classifiers make of real motions of each held-out combination."""
    for report in results.stages.values():
        cells = at(report, "real", "cells")
        if cells:
            rows = [[cell, show(v["windows"]), percent(v["style"]), percent(v["content"])] for cell, v in cells.items()]
            found = report["real"]
            rows.append(["mean of classes", show(found["windows"]), percent(found["style"]), percent(found["content"])])
            note = "Real motions of combinations that neither classifier was trained on: how far their verdicts hold."
            return Table("Judges of stylization", ["", "windows", "style accuracy", "content accuracy"], rows, note)
    return None
