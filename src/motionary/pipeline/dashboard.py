"""The dashboard: ``python -m motionary.pipeline.dashboard`` serves MLflow's page and says where its curves are."""

from __future__ import annotations

import argparse
import json
import os
import sqlite3
import sys
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

from motionary.pipeline.delivery import main as send_left_rows
from motionary.pipeline.journal import rehome, tracking_uri

VIEW = "motionary"
_VIEW_TAG = f"mlflow.sharedViewState.{VIEW}"  # how MLflow keeps a view that somebody shared
_COLUMNS = 8
# Of a stage's metrics, those that compare its runs, where it has them; then any others of its report.
_FIRST = ("best_validation_loss", "best_step", "steps", "r_precision", "fid", "bleu", "mm", "accuracy")


def columns(metrics: Sequence[str]) -> list[str]:
    """The columns that a table of runs shows: how long a run took is there anyway; at most eight of its numbers."""
    told = [name for name in metrics if not name.startswith(("train/", "validation/", "system/"))]
    rank = {name: next((i for i, part in enumerate(_FIRST) if part in name), len(_FIRST)) for name in told}
    chosen = sorted(told, key=lambda name: (rank[name], name.count("."), name))[:_COLUMNS]
    return [f"metrics.`{name}`" for name in chosen]


def prepare(home: Path) -> str:
    """Gives every experiment of the project's database its columns; returns the page of the one that ran last.

    Where there is no run yet, or the runs are on a server, this is the list of experiments.
    """
    uri = tracking_uri(home)
    path = Path(uri.removeprefix("sqlite:///"))
    if not uri.startswith("sqlite:///") or not path.exists():
        return "#/experiments"
    rehome(home)
    with closing(sqlite3.connect(path, timeout=30)) as database, database:
        found = database.execute(
            "SELECT r.experiment_id, m.key FROM runs r JOIN latest_metrics m ON m.run_uuid = r.run_uuid "
            "WHERE r.lifecycle_stage = 'active' GROUP BY r.experiment_id, m.key"
        ).fetchall()
        names: dict[int, list[str]] = {}
        for experiment, key in found:
            names.setdefault(experiment, []).append(key)
        for experiment, metrics in names.items():
            view = json.dumps({"selectedColumns": columns(metrics), "orderByKey": "attributes.start_time"})
            row = (experiment, _VIEW_TAG, view)
            database.execute("INSERT OR REPLACE INTO experiment_tags (experiment_id, key, value) VALUES (?, ?, ?)", row)
        last = database.execute(
            "SELECT r.experiment_id FROM runs r JOIN metrics m ON m.run_uuid = r.run_uuid "
            "WHERE m.key = 'validation/loss' ORDER BY r.start_time DESC LIMIT 1"
        ).fetchone()
    if last is None:
        return "#/experiments"
    return f"#/experiments/{last[0]}/runs?viewStateShareKey={VIEW}&compareRunsMode=CHART"


def main(arguments: Sequence[str]) -> int:
    """Sends rows that are left, prepares the pages and serves them until it is interrupted."""
    parser = argparse.ArgumentParser(prog="python -m motionary.pipeline.dashboard", description=__doc__)
    parser.add_argument("--port", type=int, default=5000, help="of the page, on this machine alone (5000)")
    port = parser.parse_args(arguments).port
    send_left_rows([])
    page, home = prepare(Path.cwd()), Path.cwd()
    print(f"curves of the last training: http://127.0.0.1:{port}/{page}", flush=True)
    print("each stage is an experiment; a sweep is a run with its children below it", flush=True)
    command = ["mlflow", "ui", "--backend-store-uri", tracking_uri(home), "--host", "127.0.0.1", "--port", str(port)]
    os.execvp(sys.executable, [sys.executable, "-m", *command])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
