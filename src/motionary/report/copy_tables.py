"""What of the test split stands in training already."""

from __future__ import annotations

from motionary.report.results import Results, at
from motionary.report.table import Table, percent, show

NOTE = (
    "Share of test captions that training has word for word once normalized; share of test windows with a training"
    " window within 15 mm, and the distance to the nearest for half of them: the mean over the joints of 16 poses from"
    " start to end, the root's path and heading removed. A system that copies scores this much."
)


def copies(results: Results) -> Table | None:
    """Captions and motions of the test split that training has."""
    rows = []
    for report in results.stages.values():
        for part, found in (at(report, "copies") or {}).items():
            shares = percent(found.get("word_for_word")), percent(found["near"])
            rows.append([part, show(found["captions"]), shares[0], show(found["windows"]), shares[1]])
            rows[-1].append(show(found["nearest_mm"], 1))
    columns = ["part", "captions", "in training", "windows", "within 15 mm", "nearest, mm (median)"]
    return Table("What training has of the test split", columns, rows, NOTE) if rows else None
