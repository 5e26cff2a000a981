"""Whether generated, reconstructed and stylized motions look possible, beside real ones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from motionary.report.results import Results, at, with_variants
from motionary.report.table import NONE, Table, show

# Heading, key and what its value is multiplied by: metres are shown as millimetres, shares as percent.
PHYSICS = (
    ("Foot skating, m/s", "foot_skating", 1.0),
    ("Penetration, mm", "penetration", 1000.0),
    ("Floating, %", "floating", 100.0),
    ("Jerk, m/s³", "jitter", 1.0),
    ("Bone change, mm", "bone_change", 1000.0),
)
NOTE = (
    "Means over motions. Skating: speed over the ground of feet that stand. Penetration: depth of the lowest joint"
    " below the floor. Floating: frames without a joint within 5 cm of the floor. Jerk: third derivative of the joints."
    " Bone change: distance of a bone's length from its mean. Near the real motions' is best."
)


def physics_tables(results: Results) -> list[Table]:
    """A table of the systems that the evaluation scored, and one for each kind of stylized content."""
    rows = []
    scored = results.having("physics")
    if real := next((found for report in scored.values() if (found := at(report, "physics", "real"))), None):
        rows.append(_row("real motions", real))
    for name, report in with_variants(scored, "real_lengths", "planted").items():
        for kind, label in (("reconstructed", "real, through {}"), ("generated", "{}")):
            if found := at(report, "physics", kind):
                rows.append(_row(label.format(name), found))
    return ([_table("Physics", rows)] if rows else []) + _stylized(results)


def physics_table(title: str, rows: Mapping[str, Mapping[str, Any]]) -> Table:
    """A table of measures by the name of each row."""
    return _table(title, [_row(name, values) for name, values in rows.items()])


def _stylized(results: Results) -> list[Table]:
    tables = []
    for report in results.stages.values():
        for part, found in (at(report, "style_transfer") or {}).items():
            rows = {name: values for name, values in found["rows"].items() if PHYSICS[-1][1] in values}
            if rows:
                tables.append(_table(f"Physics of stylization: {part}", [_row(n, v) for n, v in rows.items()]))
    return tables


def _table(title: str, rows: list[list[str]]) -> Table:
    return Table(title, ["", *(heading for heading, *_ in PHYSICS)], rows, NOTE)


def _row(name: str, found: Mapping[str, Any]) -> list[str]:
    return [name, *(_scaled(found.get(key), factor) for _, key, factor in PHYSICS)]


def _scaled(value: Any, factor: float) -> str:
    if value is None:
        return NONE
    if isinstance(value, Mapping):
        return show({name: number * factor for name, number in value.items()})
    return show(value * factor)
