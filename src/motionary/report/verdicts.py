"""What several judges say together: by how much they agree, which claims both make, and which generator is best."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from math import prod
from typing import Any

from motionary.report.results import Results, at
from motionary.report.table import NONE, Table
from motionary.systems.registry import SEARCH, TEXT_TO_MOTION, known

# Metric and whether more of it is better.
CLAIMS = (("R@3", "r3", True), ("FID", "fid", False))


def judges_of(results: Results) -> list[str]:
    """Names of the judges beyond the first, in the order of the reports."""
    names: dict[str, None] = {}
    for report in results.systems.values():
        names |= dict.fromkeys(list(report.get("judges", {}))[1:])
    return list(names)


def verdicts_table(results: Results) -> Table | None:
    """For each pair of generators, which is better by each judge; a claim counts where all say the same."""
    systems, others = results.having("generation"), judges_of(results)
    if len(systems) < 2 or not others:
        return None
    first = next(iter(next(iter(systems.values()))["judges"]))
    columns = ["", *(f"{metric}, {judge}" for metric, *_ in CLAIMS for judge in (first, *others))]
    rows = []
    for a, b in combinations(systems, 2):
        rows.append([f"{a} or {b}"])
        for _, key, more in CLAIMS:
            rows[-1] += [_better(systems, (a, b), key, more, judge) for judge in (None, *others)]
    agreed = {judge: at(report, "agreement", judge) for report in systems.values() for judge in others}
    told = ", ".join(f"{value:.2f} for {judge}" for judge, value in agreed.items() if value is not None)
    note = (
        "Which of two systems each judge puts first; a dash where their intervals meet. A claim counts where all judges"
        f" say the same. Spearman correlation with {first}'s ranks of real motions: {told or NONE}."
    )
    return Table("Do the judges agree?", columns, [[*row] for row in rows], note)


def preferred(results: Results) -> dict[str, Any]:
    """The generator with the lowest FID by every judge, of those that do not copy the corpus.

    Where the judges name several, it is the one of these whose FIDs have the lowest geometric mean: each judge has a
    scale of its own.

    Returns:
        {"text_to_motion": its name, or None where there is but one judge; "fid": each judge's FID of every system}.
    """
    fid: dict[str, dict[str, float]] = {}
    for name, report in results.having("generation").items():
        copies = name in known() and SEARCH in known()[name].offers
        values = {judge: at(report, *_row(judge), "fid", "mean") for judge in (None, *judges_of(results))}
        if not copies and None not in values.values():
            for judge, value in values.items():
                fid.setdefault(judge or next(iter(report.get("judges", {"": ""}))), {})[name] = value
    best = sorted({min(found, key=lambda name: found[name]) for found in fid.values()})
    chosen = min(best, key=lambda name: prod(found[name] for found in fid.values())) if len(fid) > 1 else None
    return {TEXT_TO_MOTION: chosen, "fid": fid}


def _row(judge: str | None) -> tuple[str, ...]:
    """Where a report of generation keeps a judge's row over all items; None is the first judge."""
    return ("generation", "all") if judge is None else ("generation", "all", "by", judge)


def _better(
    systems: Mapping[str, dict[str, Any]], pair: tuple[str, str], key: str, more: bool, judge: str | None
) -> str:
    """The better of a pair by one judge; a dash where the intervals overlap or a value is missing."""
    values = [at(systems[name], *_row(judge), key) for name in pair]
    if None in values:
        return NONE
    difference = values[0]["mean"] - values[1]["mean"]
    if abs(difference) <= sum(value.get("half", 0.0) for value in values):
        return NONE
    return pair[0] if (difference > 0) == more else pair[1]
