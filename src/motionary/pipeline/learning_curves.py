"""Training curves as a table for DVC and as a figure."""

from __future__ import annotations

import csv
from pathlib import Path

from motionary.training.loop import History


def write_curves(history: History, path: Path) -> None:
    """Writes one row per logged step: step, train_<name>..., validation_<name>... (empty where not logged)."""
    rows: dict[int, dict[str, float]] = {}
    for place, part in (("train", history.train), ("validation", history.validation)):
        for row in part:
            target = rows.setdefault(int(row["step"]), {})
            target.update({f"{place}_{name}": value for name, value in row.items() if name != "step"})
    names = sorted({name for row in rows.values() for name in row})
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, ["step", *names], restval="")
        writer.writeheader()
        writer.writerows({"step": step, **rows[step]} for step in sorted(rows))


def draw_curves(history: History, title: str):
    """A matplotlib figure: one panel per logged value that changes, training and validation together."""
    from matplotlib.figure import Figure

    names = [name for name in _logged(history) if _changes(history, name)]
    columns = min(4, max(1, len(names)))
    lines = -(-len(names) // columns) or 1
    figure = Figure(figsize=(3.4 * columns, 2.5 * lines))
    for place, name in enumerate(names):
        axis = figure.add_subplot(lines, columns, place + 1)
        for rows, label, width in ((history.train, "train", 0.8), (history.validation, "validation", 1.6)):
            points = [(row["step"], row[name]) for row in rows if name in row]
            if points:
                axis.plot(*zip(*points, strict=True), label=label, linewidth=width)
        axis.set_title(f"{title}: {name}", fontsize=9)
        axis.tick_params(labelsize=7)
        axis.grid(alpha=0.3)
        if place == 0:
            axis.legend(fontsize=7)
    figure.tight_layout()
    return figure


def _logged(history: History) -> list[str]:
    return sorted({n for row in (*history.train, *history.validation) for n in row} - {"step", "learning_rate"})


def _changes(history: History, name: str) -> bool:
    """Whether training or validation logged two different values."""
    return any(len({row[name] for row in rows if name in row}) > 1 for rows in (history.train, history.validation))
