"""How the files of a root were read: counted for the report."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from motionary.formats.read.reading_options import Reading

_MOST = 100  # notes kept word for word


@dataclass
class ReadingCounts:
    """What was decided for each file of one root."""

    up: Counter[str] = field(default_factory=Counter)
    unit: Counter[str] = field(default_factory=Counter)
    roles: Counter[str] = field(default_factory=Counter)
    mirrored: int = 0
    skipped_first: int = 0
    notes: list[str] = field(default_factory=list)
    uncertain: int = 0

    def add(self, reading: Reading, where: str) -> None:
        """Count one file, which `where` names."""
        self.up[reading.up] += 1
        self.unit[f"{reading.unit:.6g}"] += 1
        self.roles[reading.roles] += 1
        self.mirrored += reading.mirrored
        self.skipped_first += reading.skipped_first
        self.uncertain += bool(reading.notes)
        if reading.notes and len(self.notes) < _MOST:
            self.notes.append(f"{where}: {'; '.join(reading.notes)}")

    def report(self) -> dict[str, Any]:
        """Counts of files by up axis, by metres per unit and by source of the roles; how many were mirrored, lost their
        first frame or are uncertain, and why."""
        counted = {"up": self.up, "unit": self.unit, "roles": self.roles}
        return {name: dict(sorted(counts.items())) for name, counts in counted.items()} | {
            "mirrored": self.mirrored,
            "skipped_first": self.skipped_first,
            "uncertain": self.uncertain,
            "notes": self.notes,
        }
