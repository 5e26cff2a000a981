"""Everything that the stages reported, read from reports/; whatever is missing is left out."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from motionary.errors import InputError

# Parts of a report that are reports of the same system used in another way -> the name of their row.
VARIANTS = {
    "real_lengths": "{name} with real lengths",
    "planted": "{name}, feet planted",
    "consensus": "{name} by consensus of {draws} draws",
}
OWN = ("summary.json", "preferred.json")  # what the report itself writes there


@dataclass(frozen=True)
class Results:
    """What there is to show.

    Attributes:
        systems: each system's evaluation, by its name.
        stages: each stage's own report, by its name.
        figures: pictures of each stage, by its name.
    """

    systems: Mapping[str, dict[str, Any]] = field(default_factory=dict)
    stages: Mapping[str, dict[str, Any]] = field(default_factory=dict)
    figures: Mapping[str, list[Path]] = field(default_factory=dict)

    @classmethod
    def read(cls, reports: Path) -> Results:
        """Reads a folder of reports; InputError names a file that is not JSON."""
        folders = sorted(path for path in (reports / "figures").glob("*") if path.is_dir())
        return cls(
            systems={path.stem: _json(path) for path in sorted((reports / "evaluation").glob("*.json"))},
            stages={path.stem: _json(path) for path in sorted(reports.glob("*.json")) if path.name not in OWN},
            figures={folder.name: pictures for folder in folders if (pictures := sorted(folder.glob("*.png")))},
        )

    def having(self, key: str) -> dict[str, dict[str, Any]]:
        """The systems whose evaluation has this key."""
        return {name: report for name, report in self.systems.items() if key in report}

    @property
    def evaluators(self) -> list[str]:
        """Hashes of the evaluators that judged the systems: one a judge, unless reports of several runs are mixed."""
        found = [[report.get("judge"), *report.get("judges", {}).values()] for report in self.systems.values()]
        return sorted({judge for judges in found for judge in judges if judge})


def at(report: Any, *keys: str) -> Any:
    """The value below nested keys, None where any is missing."""
    for key in keys:
        if not isinstance(report, Mapping) or key not in report:
            return None
        report = report[key]
    return report


def parts_of(reports: Mapping[str, Any], key: str) -> list[str]:
    """Names of the parts that any of the reports has below `key`, "all" first."""
    names = dict.fromkeys(part for report in reports.values() for part in report[key])
    return sorted(names, key=lambda part: part != "all")


def with_variants(systems: Mapping[str, dict[str, Any]], *kinds: str) -> dict[str, dict[str, Any]]:
    """Each report, then as rows of their own those of its parts that are VARIANTS of these kinds."""
    out = {}
    for name, report in systems.items():
        out[name] = report
        for kind in kinds:
            if kind in report:
                out[VARIANTS[kind].format(name=name, **report[kind])] = report[kind]
    return out


def _json(path: Path) -> dict[str, Any]:
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(path, error, "must be JSON written by a stage; run it again") from None
    if not isinstance(value, dict):
        raise InputError(path, type(value).__name__, "must be a JSON object written by a stage")
    return value
