"""Sends one stage's journal to MLflow: what is new in it, to the run that it began or continues."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from filelock import FileLock

from motionary.pipeline.journal import ARTIFACTS, identity, probe, records, rehome, sweep_name, tracking_uri

_LOOKS, _MOVING = 4, 0.25  # for a file that is not there, and seconds between them
# MLflow waits minutes for a server that is not there; what is set already stays.
_DEFAULTS = {
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "1",
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "10",
    "MLFLOW_LOGGING_LEVEL": "ERROR",
}


class Replaced(Exception):
    """The database file was deleted, or another stands in its place: MLflow's connection leads nowhere."""


class Sender:
    """Sends journals to the one tracking server or database of the project at `home`."""

    def __init__(self, home: Path):
        for name, value in _DEFAULTS.items():
            os.environ.setdefault(name, value)
        self.home, self.uri = home, tracking_uri(home)
        self.client: Any = None
        self._runs: dict[Path, str] = {}
        self._file: tuple[int, int] | None = None

    def send(self, journal: Path) -> None:
        """Sends what is new in the journal; raises whatever MLflow or the way to it raises."""
        try:
            self._send(journal)
        except Exception:
            self._check_file()  # of a database that was deleted, MLflow says this and that
            raise

    def _send(self, journal: Path) -> None:
        run_id = self._run(journal)
        mark = journal.with_suffix(".sent")  # the run, and how much of the journal it has
        known = mark.read_text().split() if mark.exists() else []
        metrics: list[Any] = []
        offset = start = int(known[1]) if len(known) == 2 and known[0] == run_id else 0
        for record, end in records(journal, start):
            if record["kind"] == "metrics":
                metrics += _metrics(record)
            if record["kind"] != "metrics" or len(metrics) >= 500:
                self._flush(run_id, metrics)
                self._one(run_id, record)
                mark.write_text(f"{run_id} {end}")
            offset = end
        self._flush(run_id, metrics)
        self._check_file()
        mark.write_text(f"{run_id} {offset}")

    def _flush(self, run_id: str, metrics: list[Any]) -> None:
        while metrics:
            self.client.log_batch(run_id, metrics=metrics[:900])
            del metrics[:900]

    def _one(self, run_id: str, record: Mapping[str, Any]) -> None:
        """Sends a record that is no row of metrics."""
        self._check_file()
        if record["kind"] == "run":
            self._describe(run_id, record)
        elif record["kind"] == "artifact":
            self._store(run_id, record["path"], record["folder"])
        elif record["kind"] == "end":
            self.client.set_terminated(run_id, record["status"], record["time"])

    def _store(self, run_id: str, path: str, folder: str | None) -> None:
        """Stores a file; one that is gone was made anew since, or is just now moved to DVC's cache and linked back."""
        for _ in range(_LOOKS):
            if Path(path).is_file():
                try:
                    return self.client.log_artifact(run_id, path, folder)
                except FileNotFoundError as error:
                    if error.filename != path:
                        raise
            time.sleep(_MOVING)
        return None

    def _describe(self, run_id: str, record: Mapping[str, Any]) -> None:
        from mlflow.entities import Param, RunTag
        from mlflow.exceptions import MlflowException

        pairs = [Param(name, value) for name, value in record["params"].items()]
        try:
            for start in range(0, len(pairs), 100):
                self.client.log_batch(run_id, params=pairs[start : start + 100])
        except MlflowException as error:
            # A resumed run already has its params; values that cannot affect the result may differ.
            if error.error_code != "INVALID_PARAMETER_VALUE":
                raise
        self.client.log_batch(run_id, tags=[RunTag(name, value) for name, value in record["tags"].items()])

    def _run(self, journal: Path) -> str:
        """The journal's run: that of the killed stage before it, or a new one."""
        self._check_file()
        if journal in self._runs:
            return self._runs[journal]
        if self.client is None:
            probe(self.uri)
        from mlflow import MlflowClient  # imported late: it takes seconds
        from mlflow.exceptions import MlflowException

        record, note = next(records(journal))[0], journal.with_name("run_id.txt")
        # The schema is created and experiments are added by one process at a time.
        with FileLock(self.home / ".cache" / "mlflow.lock", timeout=60):
            if self.client is None:
                self.client = MlflowClient(self.uri)
                rehome(self.home)
                self._file = identity(self.uri)
            try:
                run_id = note.read_text().strip()
                self.client.update_run(run_id, status="RUNNING")
            except (FileNotFoundError, MlflowException) as error:
                absent = ("RESOURCE_DOES_NOT_EXIST", "INVALID_PARAMETER_VALUE")  # the second: it was deleted
                if isinstance(error, MlflowException) and error.error_code not in absent:
                    raise
                run_id = self._new_run(record)
                note.write_text(run_id)
        self._runs[journal] = run_id
        return run_id

    def _new_run(self, record: Mapping[str, Any]) -> str:
        experiment, tags = self._experiment(record["experiment"]), {}
        if record["sweep"]:
            tags["mlflow.parentRunId"] = self._parent(Path(record["sweep"]), experiment)
        run = self.client.create_run(experiment, start_time=record["time"], run_name=record["name"], tags=tags)
        return run.info.run_id

    def _experiment(self, name: str) -> str:
        found = self.client.get_experiment_by_name(name)
        if found is not None:
            return found.experiment_id
        location = None if os.environ.get("MLFLOW_TRACKING_URI") else (self.home / ARTIFACTS / name).as_uri()
        return self.client.create_experiment(name, artifact_location=location)

    def _parent(self, sweep: Path, experiment: str) -> str:
        sweep.mkdir(parents=True, exist_ok=True)
        note = sweep / "mlflow_parent.txt"
        if not note.exists():
            run = self.client.create_run(experiment, run_name=sweep_name(sweep))
            self.client.set_terminated(run.info.run_id)
            note.write_text(run.info.run_id)
        return note.read_text().strip()

    def _check_file(self) -> None:
        """SQLite goes on writing to a deleted file as if nothing had happened."""
        if self.client is not None and identity(self.uri) != self._file:
            raise Replaced("the database was deleted or replaced")


def _metrics(record: Mapping[str, Any]) -> list[Any]:
    from mlflow.entities import Metric

    return [Metric(name, value, record["time"], record["step"]) for name, value in record["values"].items()]
