"""Results in a terminal: ``python -m motionary.report.summary``; with ``markdown``, the tables of the README."""

from __future__ import annotations

import sys
from pathlib import Path

from motionary.errors import exit_code
from motionary.report import caption_tables, tables
from motionary.report.action_tables import action_tables
from motionary.report.copy_tables import copies
from motionary.report.physics_tables import physics_tables
from motionary.report.position_tables import position_tables
from motionary.report.results import Results
from motionary.report.style_tables import classifiers_table, stylization_tables
from motionary.report.table import NONE, Table
from motionary.report.verdicts import verdicts_table


def main_tables(results: Results) -> list[Table]:
    """The main result tables, in the order in which they are shown."""
    found = [tables.text_to_motion(results), *tables.by_other_judges(results), verdicts_table(results)]
    found += [caption_tables.motion_to_text(results), tables.reconstruction(results), tables.lengths(results)]
    found += [*stylization_tables(results)[:1], *action_tables(results)[:1]]
    return [table for table in found if table is not None]


def terminal(reports: Path) -> str:
    """A short aligned table, and where the page lies."""
    results = Results.read(reports)
    page = reports / "index.html"
    found = main_tables(results)
    blocks = [_without_intervals(table).text() for table in found] or [f"no evaluation in {reports}: run `dvc repro`\n"]
    if page.exists():
        blocks.append(f"The whole report, with players: {page}\n")
    return "\n".join(blocks)


def markdown(reports: Path) -> str:
    """All result tables as Markdown."""
    results = Results.read(reports)
    styled = [*stylization_tables(results)[1:], classifiers_table(results)]
    extra = [
        caption_tables.raw_captions(results),
        caption_tables.captions_by_labels(results),
        *physics_tables(results),
        *position_tables(results),
        *styled,
        *action_tables(results)[1:],
        tables.nearest_training(results),
        copies(results),
        *tables.parts_tables(results),
    ]
    return "\n".join(table.markdown() for table in (*main_tables(results), *extra) if table is not None)


def _without_intervals(table: Table) -> Table:
    rows = [[cell.split(" ± ")[0] for cell in row] for row in table.rows]
    empty = {i for i in range(1, len(table.columns)) if all(row[i] == NONE for row in rows)}
    keep = [i for i in range(len(table.columns)) if i not in empty]
    note = table.note.split("; ±")[0].rstrip(".")
    title = f"{table.title} ({note})" if note else table.title
    return Table(title, [table.columns[i] for i in keep], [[row[i] for i in keep] for row in rows])


def main(arguments: list[str] | None = None) -> int:
    """Prints the results below the current folder; exit code 2 on an unreadable report."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if arguments not in ([], ["markdown"]):
        print("usage: python -m motionary.report.summary [markdown]", file=sys.stderr)
        return 2
    return exit_code(lambda: print((markdown if arguments else terminal)(Path("reports")), end=""))


if __name__ == "__main__":
    sys.exit(main())
