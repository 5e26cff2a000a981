"""The few numbers of a report that DVC shows: ``dvc metrics show`` has a column for every name that any stage uses, so
that all stages use the same few, of which names and digits are short: the table fits into 120 columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

# Of the many rows of style_evaluation and action_evaluation: the thesis's own way, where it is scored.
_STYLE = ("style_transfer", "*", "rows", "motion-based (S)")
_ACTION = ("action_generation", "coarse", "rows", "glmi_m")
# Column -> where reports keep its number, the first that there is; "*" is any key.
COLUMNS: dict[str, tuple[tuple[str, ...], ...]] = {
    "items": (("total", "windows"), ("windows",), ("items",)),
    "loss": (("training", "best_validation_loss"), ("*", "best_validation_loss")),
    "mm": (("positions", "all", "local_mm"),),
    "r3": (("generation", "all", "r3"), ("captioning", "all", "r3"), ("reconstruction", "all", "r3")),
    "fid": (("generation", "all", "fid"), ("reconstruction", "all", "fid"), (*_ACTION, "fid")),
    "asked": (("oracle", "prompts", "confirmed"),),
    "slide": (("physics", "generated", "foot_skating"), ("physics", "reconstructed", "foot_skating")),
    "bleu": (("language", "all", "bleu4"),),
    "acc": (("real", "style"), ("real", "coarse", "macro"), (*_STYLE, "style_accuracy"), (*_ACTION, "accuracy")),
}


def short(report: Mapping[str, Any]) -> dict[str, float]:
    """The numbers of a stage's report by the names of COLUMNS, without intervals.

    `items` are windows of the corpus, or of the test split; `loss` is the lowest on the validation split, of the first
    model of a stage; `mm` how far decoded joints lie from the true ones; `r3`, `fid` and `bleu` (BLEU-4) are those of
    the report's main tables; `asked` is the share of prompts that the oracle confirms; `slide` of feet in m/s; `acc` a
    judge's accuracy on real motions, or on what was made.
    """
    found = {}
    for name, places in COLUMNS.items():
        value = next((value for place in places for value in _numbers(report, *place)), None)
        if value is not None:
            found[name] = value if isinstance(value, int) else _rounded(value, 4 if name == "loss" else 3)
    return found


def _rounded(value: float, digits: int) -> float:
    """To so many digits, and decimals."""
    value = round(float(f"{value:.{digits}g}"), digits)
    return int(value) if abs(value) >= 100 else value


def _numbers(report: Any, *place: str) -> Iterator[float]:
    """The numbers, or means of intervals, at nested keys."""
    if not place:
        value = report.get("mean") if isinstance(report, Mapping) else report
        if isinstance(value, int | float) and not isinstance(value, bool):
            yield value
    elif isinstance(report, Mapping):
        for key in report if place[0] == "*" else {place[0]} & report.keys():
            yield from _numbers(report[key], *place[1:])
