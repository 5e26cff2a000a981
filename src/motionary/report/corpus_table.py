"""What was read, what was dropped and why, and how it was split."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from motionary.report.table import Table, show

COUNTS = ("windows", "captioned", "mirrored", "minutes")


def corpus_tables(report: Mapping[str, Any]) -> list[Table]:
    """Tables of the preprocess stage's report."""
    facts = [
        ("clips read", f"{show(report.get('read'))} ({show(report.get('minutes_read'), 1)} minutes)"),
        ("clips kept", show(report.get("kept"))),
        ("captions", show(report.get("captions"))),
        ("problems", show(report.get("problem_count"))),
    ]
    tables = [Table(f"Corpus: {report.get('name', 'unnamed')}", ["", "number"], facts)]
    for title, key in (("Splits", "splits"), ("Roots", "roots")):
        rows = [[name, *(show(values.get(c), 1) for c in COUNTS)] for name, values in (report.get(key) or {}).items()]
        if rows:
            note = "Mirrored copies are made of training windows only." if key == "splits" else ""
            tables.append(Table(title, [key.rstrip("s"), *COUNTS], rows, note))
    if dropped := report.get("dropped"):
        tables.append(Table("Dropped", ["reason", "segments"], [[name, show(n)] for name, n in dropped.items()]))
    if problems := report.get("problems"):
        rows = [[str(p.get(key, "")) for key in ("file", "value", "rule")] for p in problems[:50]]
        count = report.get("problem_count", len(problems))
        note = f"The first {len(rows)} of {count}." if count > len(rows) else ""
        tables.append(Table("Problems", ["file", "value", "rule"], rows, note))
    return tables
