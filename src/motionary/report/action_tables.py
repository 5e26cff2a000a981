"""The tables of motions made of action labels: by kind of label (thesis Tables 3.2, 3.3), locomotion (3.6), physics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from motionary.report.physics_tables import physics_table
from motionary.report.results import Results, at
from motionary.report.table import NONE, Table, show

SCORED = (
    ("FID ↓", "fid"),
    ("Accuracy ↑", "accuracy"),
    ("Diversity →", "diversity"),
    ("Multimodality →", "multimodality"),
    ("Foot skating, m/s →", "foot_skating"),
)
NOTE = (
    "Labels and lengths are those of {items} real motions. → nearer to real motions is better. FID of real motions is "
    "that of two halves of them; FID of training motions is what copying them would reach. ± is the 95% interval over "
    "{repetitions} repetitions."
)


def action_tables(results: Results) -> list[Table]:
    """A table for each kind of label that was scored, one for each analysed action, and one of physics."""
    tables = []
    for report in results.stages.values():
        found = at(report, "action_generation")
        if not found:
            continue
        parts = {f"Motions of {kind} actions": found[kind] for kind in ("coarse", "fine") if kind in found}
        parts |= {f"Locomotion: {action}": part for action, part in found.get("locomotion", {}).items()}
        tables += [_table(title, part, report["repetitions"]) for title, part in parts.items()]
        if found.get("physics"):
            tables.append(physics_table("Physics of motions of actions", found["physics"]))
    return tables


def _table(title: str, part: Mapping[str, Any], repetitions: int) -> Table:
    shown = [(heading, key) for heading, key in SCORED if any(key in values for values in part["rows"].values())]
    rows = [[row, *(show(values.get(key, NONE)) for _, key in shown)] for row, values in part["rows"].items()]
    return Table(title, ["", *(h for h, _ in shown)], rows, NOTE.format(items=part["items"], repetitions=repetitions))
