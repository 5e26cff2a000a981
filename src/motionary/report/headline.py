"""The one table that says how good each system is, and what each of them is."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from motionary.report.results import Results, at
from motionary.report.table import NONE, Table, percent, show
from motionary.systems.registry import known

_COLUMNS = (
    "",
    "motion fits text, R@3",
    "FID",
    "does what is asked",
    "feet slide, m/s",
    "text fits motion, R@3",
    "BLEU-4",
    "CIDEr",
)
_NOTE = (
    "The main numbers; what they mean is told under “How to read the numbers”, and all others, with their intervals, "
    "stand folded below. The first row is the measure."
)


def headline(results: Results) -> Table | None:
    """Every evaluated system that makes motions or captions, below real motions; columns without a number are left
    out."""
    made = {n: r for n, r in results.systems.items() if "generation" in r or "language" in r}
    if not made:
        return None
    rows = [["real motions and captions", *_real(made)], *([name, *_own(report)] for name, report in made.items())]
    kept = [i for i in range(len(_COLUMNS)) if i == 0 or any(row[i] != NONE for row in rows)]
    return Table("", [_COLUMNS[i] for i in kept], [[row[i] for i in kept] for row in rows], _NOTE)


def _own(report: Mapping[str, Any]) -> list[str]:
    return [
        _mean(at(report, "generation", "all", "r3")),
        _mean(at(report, "generation", "all", "fid")),
        percent(at(report, "oracle", "prompts", "confirmed")),
        _mean(at(report, "physics", "generated", "foot_skating")),
        _mean(at(report, "captioning", "all", "r3")),
        _mean(at(report, "language", "all", "bleu4")),
        _mean(at(report, "language", "all", "cider")),
    ]


def _real(systems: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """What the same judges say of real motions and captions; of words there is nothing to say."""
    makers = [report for report in systems.values() if "generation" in report]
    writers = [report for report in systems.values() if "language" in report]
    first, writer = (next(iter(found), {}) for found in (makers, writers))
    judged = at(first, "real", "all")
    captions = at(writer, "caption_real", "all", "r3") or at(writer, "real", "all", "r3")
    cells = [_mean(at(judged, "r3")), _mean(at(judged, "fid")), NONE]
    return [*cells, _mean(at(first, "physics", "real", "foot_skating")), _mean(captions), NONE, NONE]


def _mean(value: Any) -> str:
    """Without its interval, which the tables below have."""
    return show(value.get("mean") if isinstance(value, Mapping) else value)


def systems_html(results: Results) -> str:
    """What each evaluated system is, in a sentence."""
    told = [(name, known()[name].about) for name in results.systems if name in known()]
    entries = "".join(f"<dt>{escape(name)}</dt><dd>{escape(about)}</dd>" for name, about in told if about)
    return f"<dl class='systems'>{entries}</dl>" if entries else ""
