"""A sweep (``python stages/tokenizer.py -m key=a,b``) as a whole: its jobs' lines, and the table that it ends with.

Hydra calls :class:`SweepTable`, which ``conf/config.yaml`` names; DVC composes without it.
"""

from __future__ import annotations

import atexit
import io
import json
import os
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stderr
from math import inf
from pathlib import Path
from typing import Any, TextIO

import yaml
from hydra.core.hydra_config import HydraConfig
from hydra.experimental.callback import Callback
from hydra.types import RunMode
from omegaconf import DictConfig

from motionary.pipeline.journal import sweep_name

SECONDS = 10.0  # between two lines of one bar
_WIDEST = 40  # characters of a swept value in the table
_BASIC = "BasicLauncher"  # Hydra's own launcher runs one job after another; all others run several at once


class JobLines(io.TextIOBase):
    """What one of several jobs at once writes, as whole lines behind its label: bars would overwrite each other.

    Args:
        stream: takes the lines.
        label: stands before each of them.
        seconds: at least so long between two lines of a bar; its end is told in any case.
    """

    def __init__(self, stream: TextIO, label: str, seconds: float = SECONDS):
        self._stream, self._label, self._seconds = stream, label, seconds
        self._begun, self._next = "", 0.0

    def write(self, text: str) -> int:
        """Passes on lines that have ended, and a bar (text behind a carriage return) when it is time to."""
        *lines, self._begun = (self._begun + text).split("\n")
        for line in lines:
            self._say(line)
        if "\r" in self._begun and time.monotonic() >= self._next:
            self._next = time.monotonic() + self._seconds
            self._say(self._begun)
            self._begun = ""
        return len(text)

    def _say(self, line: str) -> None:
        """What a terminal would show of the line in the end."""
        if shown := line.rsplit("\r", 1)[-1].rstrip():
            self._stream.write(f"{self._label} {shown}\n")  # at once, so that lines of two jobs do not mix
            self._stream.flush()


@contextmanager
def own_lines() -> Iterator[None]:
    """Context of one job: beside others, its standard error comes in lines behind the number that Hydra gave it."""
    hydra = HydraConfig.get() if HydraConfig.initialized() else None
    if hydra is None or hydra.mode != RunMode.MULTIRUN or hydra.launcher["_target_"].endswith(_BASIC):
        yield
        return
    lines = JobLines(sys.stderr, f"#{hydra.job.num}")
    with redirect_stderr(lines):
        try:
            yield
        finally:
            lines.write("\n")


class SweepTable(Callback):
    """Ends a sweep with its table, also one that a bad value or a user has stopped."""

    def on_multirun_start(self, config: DictConfig, **_: Any) -> None:
        """Before the first job, in the process that starts them all."""
        atexit.register(_show, Path(config.hydra.sweep.dir), config.hydra.job.name)


def _show(folder: Path, stage: str) -> None:
    """Not through `Callback.on_multirun_end`: Hydra leaves that out where a job has failed."""
    if shown := table(folder, stage):
        print(f"\n{shown}", flush=True)


def table(folder: Path, stage: str) -> str:
    """The jobs of a sweep, lowest validation loss first, and where to see their curves; empty without a job.

    Args:
        folder: of the sweep, with a folder of each job below it.
        stage: name of the stage that was run.
    """
    jobs = [file.parents[1] for file in sorted(folder.rglob(".hydra/overrides.yaml"))]
    if not jobs:
        return ""
    chosen = [_overrides(job / ".hydra/overrides.yaml") for job in jobs]
    names = dict.fromkeys(name for values in chosen for name in values)
    swept = [name for name in names if len(jobs) == 1 or len({values.get(name) for values in chosen}) > 1]
    found = [
        (training, job, [_short(values.get(name, "")) for name in swept])
        for job, values in zip(jobs, chosen, strict=True)
        for training in _trainings(job / "reports", stage)
    ]
    found.sort(key=lambda row: (row[0][1] == inf, *row[0][:2]))
    rows = [[*swept, "model", "best validation loss", "last", "folder"]]
    rows += [[*own, model, best, last, os.path.relpath(job)] for (model, _, best, last), job, own in found]
    if {model for (model, *_), *_ in found} <= {"", "training"}:  # the stage's only model
        rows = [row[: len(swept)] + row[len(swept) + 1 :] for row in rows]
    where = f'curves: make mlflow, experiment {stage}, the runs below "{sweep_name(folder)}"'
    return "\n".join([*_aligned(rows), where])


def _overrides(file: Path) -> dict[str, str]:
    """What a job was started with: {key: value}."""
    return {name: value for name, _, value in (text.partition("=") for text in yaml.safe_load(file.read_text()))}


def _short(value: str) -> str:
    return value if len(value) <= _WIDEST else f"{value[: _WIDEST - 3]}..."


def _trainings(reports: Path, stage: str) -> list[tuple[str, float, str, str]]:
    """(model, lowest validation loss, the same and the last one as text) of every training that a stage reports."""
    written = [*reports.glob(f"{stage}.json"), *reports.glob(f"{stage}/*.json")]  # the second of an evaluation
    values = json.loads(written[0].read_text()) if written else None
    found = [(k, v) for k, v in (values or {}).items() if isinstance(v, dict) and "best_validation_loss" in v]
    if not found:
        return [("", inf, "no result" if values is None else "-", "-")]
    losses = [(k, v["best_validation_loss"], v.get("validation_loss", v["best_validation_loss"])) for k, v in found]
    return [(name, best, f"{best:.5g}", f"{last:.5g}") for name, best, last in losses]


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]
