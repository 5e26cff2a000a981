"""MLflow: one database for every run of the project, also those of queued experiments and parallel sweeps."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from motionary.pipeline.delivery import warn
from motionary.pipeline.journal import WATCHED, lock_of, tracking_uri

_LONGEST_PARAM = 6000
_PATIENCE = 60.0  # seconds without progress after which a closing stage leaves the rest for later


class Tracker:
    """One MLflow run: params, tags, metrics, figures.

    All of it is written to a journal in `folder`, which a process of its own sends (:mod:`.delivery`): no fault of
    MLflow reaches the stage, and what could not be sent is sent later.

    Args:
        home: the real project root: the database and the artifacts live there.
        experiment: name of the experiment, the stage's.
        run_name: shown in the dashboard.
        params: flattened and logged once.
        tags: logged once, beside the git commit.
        folder: of the journal; a run that was killed goes on in the next one with the same folder.
        sweep: folder of the Hydra sweep that this run is part of; its runs share one parent.
    """

    def __init__(
        self,
        home: Path,
        experiment: str,
        run_name: str,
        params: Mapping[str, Any],
        tags: Mapping[str, str],
        folder: Path,
        sweep: Path | None = None,
    ):
        folder.mkdir(parents=True, exist_ok=True)
        self.home, self.journal = home, folder / f"tracking-{time.time_ns()}.jsonl"
        self._lock = lock_of(self.journal)
        self._lock.acquire()
        self._file = self.journal.open("a", encoding="utf-8", buffering=1)  # by line: a killed stage loses none
        flat = {name: str(value)[:_LONGEST_PARAM] for name, value in flatten(params).items()}
        about = {"experiment": experiment, "name": run_name, "sweep": str(sweep) if sweep else None}
        self._watched = WATCHED in os.environ
        self._write("run", **about, watched=self._watched, params=flat, tags={**tags, **git_tags(home)})
        if self._watched:
            return
        source = str(Path(__file__).resolve().parents[2])
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([source, *sys.path])}
        command = [sys.executable, "-m", "motionary.pipeline.delivery", "follow", str(self.journal), str(home)]
        # Its standard input ends with this process, however that ends.
        self._delivery = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, cwd=home, env=environment
        )

    def _write(self, kind: str, **record: Any) -> None:
        self._file.write(json.dumps({"kind": kind, "time": int(time.time() * 1000), **record}) + "\n")

    def log(self, step: int, values: Mapping[str, float]) -> None:
        """Writes down metric values of a step."""
        self._write("metrics", step=step, values={name: float(value) for name, value in values.items()})

    def artifact(self, path: Path, folder: str | None = None) -> None:
        """Stores a file (a figure, a report) with the run."""
        self._write("artifact", path=str(path.resolve()), folder=folder)

    def close(self, failed: bool = False) -> None:
        """Marks the run as finished or failed, and waits until it is sent or that fails; if others send it, not."""
        self._write("end", status="FAILED" if failed else "FINISHED")
        self._file.close()
        if self._watched:
            self._lock.release()
            return
        assert self._delivery.stdin is not None
        self._delivery.stdin.close()
        mark, seen, deadline = self.journal.with_suffix(".sent"), "", time.monotonic() + _PATIENCE
        while self._delivery.poll() is None and time.monotonic() < deadline:
            sent = mark.read_text() if mark.exists() else ""
            if sent != seen:
                seen, deadline = sent, time.monotonic() + _PATIENCE
            time.sleep(0.05)
        if self._delivery.poll() is None:
            self._delivery.kill()
        if self._delivery.wait() not in (0, 1):  # with 1 it has said why
            reason = f"the process that sends ended with {self._delivery.returncode}"
            warn(tracking_uri(self.home), reason, self.journal.parent)
        self._lock.release()


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
    return {
        "git.commit": commit.stdout.strip(),
        "git.dirty": str(bool(dirty.stdout.strip())).lower(),
        "mlflow.source.git.commit": commit.stdout.strip(),  # the column "Version" of the dashboard
    }


def run_name(parts: Sequence[str], section: str, params: Mapping[str, Any], usual: Mapping[str, Any]) -> str:
    """What tells a run from others of its stage: `parts`, then the values that are not the usual ones, at most four.

    Args:
        parts: corpus, scale and the like; empty ones are left out.
        section: of the stage, whose own keys are shown without it.
        params, usual: of this run and in general, nested.
    """
    known, flat = flatten(usual), flatten(params)
    other = [f"{k.removeprefix(f'{section}.')}={v}" for k, v in flat.items() if k in known and known[k] != v]
    more = [f"and {len(other) - 4} more"] if len(other) > 4 else []
    return " ".join([*filter(None, parts), *other[:4], *more])


def committed_params(root: Path) -> dict[str, Any]:
    """params.yaml as it stands in the commit; empty where there is none."""
    try:
        shown = subprocess.run(
            ["git", "show", "HEAD:params.yaml"], cwd=root, capture_output=True, text=True, check=True
        )
        return dict(yaml.load(shown.stdout, getattr(yaml, "CSafeLoader", yaml.SafeLoader)))
    except (OSError, subprocess.CalledProcessError, yaml.YAMLError, TypeError, ValueError):
        return {}
