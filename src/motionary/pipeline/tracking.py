"""MLflow: one database for every run of the project, also those of queued experiments and parallel sweeps."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from filelock import FileLock

_LONGEST_PARAM = 6000


def tracking_uri(home: Path) -> str:
    """``MLFLOW_TRACKING_URI`` where it is set, otherwise the SQLite database in the project's root."""
    return os.environ.get("MLFLOW_TRACKING_URI") or f"sqlite:///{home / 'mlflow.db'}"


class Tracker:
    """One MLflow run: params, tags, batched metrics, figures.

    Args:
        home: the real project root: the database and the artifacts live there.
        experiment: name of the experiment, the stage's.
        run_name: shown in the dashboard.
        params: flattened and logged once.
        tags: logged once, beside the git commit.
        sweep: folder of the Hydra sweep that this run is part of; its runs share one parent.
        resume: file that remembers the run id of a killed stage, so that its run goes on.
    """

    def __init__(
        self,
        home: Path,
        experiment: str,
        run_name: str,
        params: Mapping[str, Any],
        tags: Mapping[str, str],
        sweep: Path | None = None,
        resume: Path | None = None,
    ):
        os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
        from mlflow import MlflowClient  # imported late: it takes seconds

        self._pending: list[Any] = []
        self.home = home
        cache = home / ".cache"
        cache.mkdir(exist_ok=True)
        # The schema is created and experiments are added by one process at a time.
        with FileLock(cache / "mlflow.lock"):
            self.client = MlflowClient(tracking_uri(home))
            experiment_id = self._experiment(experiment)
            parent = self._parent(sweep, experiment_id) if sweep else None
            self.run_id = self._run(experiment_id, run_name, resume, parent)
        flat = {name: str(value)[:_LONGEST_PARAM] for name, value in flatten(params).items()}
        self._batch(params=flat, tags={**tags, **git_tags(home)})

    def _experiment(self, name: str) -> str:
        found = self.client.get_experiment_by_name(name)
        if found is not None:
            return found.experiment_id
        location = None if os.environ.get("MLFLOW_TRACKING_URI") else (self.home / "mlartifacts" / name).as_uri()
        return self.client.create_experiment(name, artifact_location=location)

    def _parent(self, sweep: Path, experiment_id: str) -> str:
        sweep.mkdir(parents=True, exist_ok=True)
        note = sweep / "mlflow_parent.txt"
        if not note.exists():
            run = self.client.create_run(experiment_id, run_name=f"sweep {sweep.parent.name} {sweep.name}")
            self.client.set_terminated(run.info.run_id)
            note.write_text(run.info.run_id)
        return note.read_text().strip()

    def _run(self, experiment_id: str, run_name: str, resume: Path | None, parent: str | None) -> str:
        if resume is not None and resume.exists():
            from mlflow.exceptions import MlflowException

            try:
                run_id = resume.read_text().strip()
                self.client.update_run(run_id, status="RUNNING")
                return run_id
            except MlflowException:
                resume.unlink()  # the database was replaced since
        tags = {"mlflow.parentRunId": parent} if parent else {}
        run_id = self.client.create_run(experiment_id, run_name=run_name, tags=tags).info.run_id
        if resume is not None:
            resume.parent.mkdir(parents=True, exist_ok=True)
            resume.write_text(run_id)
        return run_id

    def log(self, step: int, values: Mapping[str, float]) -> None:
        """Remembers metric values of a step; they are sent in batches."""
        from mlflow.entities import Metric

        now = int(time.time() * 1000)
        self._pending += [Metric(name, float(value), now, step) for name, value in values.items()]
        if len(self._pending) >= 500:
            self.flush()

    def flush(self) -> None:
        """Sends the remembered metrics."""
        while self._pending:
            head, self._pending = self._pending[:900], self._pending[900:]
            self.client.log_batch(self.run_id, metrics=head)

    def artifact(self, path: Path, folder: str | None = None) -> None:
        """Stores a file (a figure, a report) with the run."""
        self.client.log_artifact(self.run_id, str(path), folder)

    def close(self, failed: bool = False) -> None:
        """Flushes and marks the run as finished or failed."""
        self.flush()
        self.client.set_terminated(self.run_id, "FAILED" if failed else "FINISHED")

    def _batch(self, params: Mapping[str, str], tags: Mapping[str, str]) -> None:
        from mlflow.entities import Param, RunTag
        from mlflow.exceptions import MlflowException

        pairs = [Param(name, value) for name, value in params.items()]
        try:
            for start in range(0, len(pairs), 100):
                self.client.log_batch(self.run_id, params=pairs[start : start + 100])
        except MlflowException:
            # A resumed run already has its params; values that cannot affect the result may differ.
            pass
        self.client.log_batch(self.run_id, tags=[RunTag(name, value) for name, value in tags.items()])


def flatten(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested mappings as one level with dotted names."""
    flat: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            flat |= flatten(value, f"{prefix}{name}.")
        else:
            flat[f"{prefix}{name}"] = value
    return flat


def numbers(values: Mapping[str, Any]) -> dict[str, float]:
    """The numeric leaves of a nested report, with names that MLflow accepts."""
    allowed = set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-. /")
    leaves = {}
    for name, value in flatten(values).items():
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            leaves["".join(c if c in allowed else "_" for c in name)] = float(value)
    return leaves


def git_tags(home: Path) -> dict[str, str]:
    """The commit that the working tree stands on, and whether it has changes."""
    try:
        commit = subprocess.run(["git", "rev-parse", "HEAD"], cwd=home, capture_output=True, text=True, check=True)
        dirty = subprocess.run(["git", "status", "--porcelain", "-uno"], cwd=home, capture_output=True, text=True)
    except (OSError, subprocess.CalledProcessError):
        return {}
    return {"git.commit": commit.stdout.strip(), "git.dirty": str(bool(dirty.stdout.strip())).lower()}
