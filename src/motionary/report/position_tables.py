"""How far generated joints are from those of the one real motion of their text (TEMOS Tables 1, 2 and A.7)."""

from __future__ import annotations

from motionary.report.results import Results, at
from motionary.report.table import Table, show

COLUMNS = (
    ("APE root", "ape_root"), ("trajectory", "ape_trajectory"), ("local", "ape_local"), ("global", "ape_global"),
    ("AVE root", "ave_root"), ("trajectory", "ave_trajectory"), ("local", "ave_local"), ("global", "ave_global"),
)  # fmt: skip
NOTE = (
    "Against the one real motion of each text, with its duration, for its first caption. APE: mean distance of the"
    " joints, m. AVE: mean distance of their variances over time, m². z = 0 is the mean latent; best and worst are by"
    " the root's APE. ± is the 95% interval over texts."
)


def position_tables(results: Results) -> list[Table]:
    """A table of every generator that takes lengths, and one on the joints of the Master Motor Map."""
    rows, mapped = [], []
    for name, report in results.having("joint_errors").items():
        for sample, errors in (at(report, "joint_errors", "rows") or {}).items():
            rows.append([f"{name}, {sample}", *(show(errors.get(key)) for _, key in COLUMNS)])
        for sample, errors in (at(report, "joint_errors", "mmm") or {}).items():
            mapped.append([f"{name}, {sample}", *(show(errors.get(key)) for _, key in COLUMNS)])
    headings = ["", *(heading for heading, _ in COLUMNS)]
    note = "The joints that MMM has too, .64 times as large (TEMOS Table A.6)."
    tables = [("Joints of generated and real motions", rows, NOTE), ("The same as MMM bodies", mapped, note)]
    return [Table(title, headings, found, text) for title, found, text in tables if found]
