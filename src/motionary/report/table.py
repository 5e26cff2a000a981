"""A table of text cells, drawn for a page, a README or a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

NONE = "-"


@dataclass(frozen=True)
class Table:
    """Rows of text under headings; the first column names the row.

    Attributes:
        title: above the table.
        columns: headings.
        rows: cells, as many as columns in each.
        note: what a reader must know, below the title.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""

    def html(self) -> str:
        """As an HTML figure."""
        head = "".join(f"<th>{escape(name)}</th>" for name in self.columns)
        body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>\n" for row in self.rows)
        note = f"<p class='note'>{escape(self.note)}</p>" if self.note else ""
        return (
            f"<figure class='table'><h3>{escape(self.title)}</h3>{note}<div class='scroll'>"
            f"<table><thead><tr>{head}</tr></thead><tbody>\n{body}</tbody></table></div></figure>\n"
        )

    def markdown(self) -> str:
        """As a Markdown table under its title and note."""
        lines = [f"**{self.title}**", "", *([self.note, ""] if self.note else [])]
        lines += [_row(self.columns), _row(["---", *["---:"] * (len(self.columns) - 1)])]
        return "\n".join([*lines, *(_row([cell.replace("|", "\\|") for cell in row]) for row in self.rows)]) + "\n"

    def text(self) -> str:
        """Aligned columns."""
        widths = [max(len(row[i]) for row in (self.columns, *self.rows)) for i in range(len(self.columns))]
        lines = [self.title]
        for row in (self.columns, *self.rows):
            cells = [row[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))]
            lines.append(("  " + "  ".join(cells)).rstrip())
        return "\n".join(lines) + "\n"


def show(value: Any, decimals: int = 3) -> str:
    """A number, a {"mean", "half"} with its interval, a text, or a dash for nothing."""
    if value is None:
        return NONE
    if isinstance(value, Mapping):
        half = value.get("half")
        mean = show(value.get("mean"), decimals)
        return mean if not half else f"{mean} ± {half:.{decimals}f}"
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    return str(value) if isinstance(value, int) else f"{value:.{decimals}f}"


def percent(value: Any) -> str:
    """A share as a percentage."""
    return NONE if value is None else f"{100 * value:.1f}%"


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"
