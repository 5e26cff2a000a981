"""``make check-paper``: every training stage takes one step at the papers' sizes, and its time and memory are shown.

A copy of the project in a temporary folder prepares a handful of clips of the demo corpus and trains on them, one stage
after another in a process of its own, on one thread. A stage that fails is named and the others go on.
"""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from motionary.errors import InputError
from motionary.pipeline.check import check_params
from motionary.pipeline.journal import WATCHED
from motionary.pipeline.params import write_params
from motionary.report.table import NONE, Table
from motionary.study.experiments import paths_of, read_pipeline, with_values

REPOSITORY = Path(__file__).resolve().parents[1]
COPIED = ("conf", "stages", "src", "dvc.yaml")
PREPARES = "preprocess"
# ru_maxrss counts kilobytes, on macOS bytes.
RSS_UNIT = 1 if sys.platform == "darwin" else 1024


@dataclass(frozen=True)
class Outcome:
    """What one stage took: wall time in seconds, peak resident memory in bytes; "" or why it failed."""

    stage: str
    seconds: float
    memory: int
    failure: str = ""


def copy_project(root: Path) -> Path:
    """What stages need of this project, in the new folder `root`; returns it."""
    for name in COPIED:
        source = REPOSITORY / name
        if source.is_dir():
            shutil.copytree(source, root / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
        else:
            shutil.copy(source, root)
    return root


def configure(root: Path, scale: str, clips: int) -> dict[str, Any]:
    """Writes the params.yaml of a project: that scale's, with one step of every training; returns it.

    Raises:
        InputError: no such preset, or a value that no stage would take.
    """
    presets = sorted(file.stem for file in (root / "conf" / "scale").glob("*.yaml"))
    if scale not in presets:
        raise InputError("--scale", scale, f"must be one of {', '.join(presets)}")
    data = ["data=demo", f"data.clips={clips}", "data.ratios=[0.6,0.2,0.2]", "data.workers=1", "threads=1"]
    write_params(root, root / "params.yaml", [f"scale={scale}", *data])
    trained = [name for name, section in _read(root).items() if isinstance(section, dict) and "steps" in section]
    short = [f"{name}.{key}={value}" for name in trained for key, value in (("steps", 1), ("epochs", 0))]
    write_params(root, root / "params.yaml", [f"scale={scale}", *data, *short])
    check_params(root)
    return _read(root)


def _read(root: Path) -> dict[str, Any]:
    return yaml.safe_load((root / "params.yaml").read_text(encoding="utf-8"))


def training_stages(params: Mapping[str, Any], stages: Mapping[str, Any]) -> list[str]:
    """Names of the stages that train, in the order of the map.

    Args:
        params: the composed configuration.
        stages: of dvc.yaml, with their values.
    """
    return [name for name in stages if "steps" in (params.get(name) or {})]


def run_stage(root: Path, name: str, stage: Mapping[str, Any], composed: str) -> Outcome:
    """Runs one stage of dvc.yaml as DVC would, in a process of its own.

    Args:
        composed: what stands for ${composed} in its command.
    """
    command = [sys.executable, *shlex.split(stage["cmd"].replace("${composed}", composed))[1:]]
    environment = {k: v for k, v in os.environ.items() if k != "DVC_ROOT"} | {"DVC_STAGE": name}
    environment |= {"PYTHONPATH": str(root / "src"), "OMP_NUM_THREADS": "1"}
    environment[WATCHED] = "1"  # and nobody watches: what is tracked here is of no use
    log = root / f"{name}.log"
    started = time.monotonic()
    with log.open("w") as out:
        process = subprocess.Popen(command, cwd=root, env=environment, stdin=subprocess.DEVNULL, stdout=out, stderr=out)
        _, status, used = os.wait4(process.pid, 0)
    process.returncode = code = os.waitstatus_to_exitcode(status)
    seconds, memory = time.monotonic() - started, used.ru_maxrss * RSS_UNIT
    if not code:
        return Outcome(name, seconds, memory)
    said = [line for line in log.read_text(errors="replace").splitlines() if line.strip()]
    errors = [line for line in said if line.startswith("error: ")] or said or [f"exit code {code}"]
    return Outcome(name, seconds, memory, errors[-1].removeprefix("error: "))


def run_stages(root: Path, names: Sequence[str]) -> list[Outcome]:
    """Runs these stages of a configured project in turn; one whose inputs another failed to write does not run."""
    pipeline, params = read_pipeline(root), _read(root)
    stages, composed = with_values(pipeline, params)["stages"], pipeline["vars"][0]["composed"]
    outcomes: list[Outcome] = []
    lacking: dict[str, str] = {}  # a path that is not written, and the stage that failed to
    for number, name in enumerate(names, 1):
        missing = [lacking[path] for path in paths_of(stages[name], "deps") if path in lacking]
        if missing:
            outcome = Outcome(name, 0.0, 0, f"not run, since it needs {missing[0]}")
        else:
            outcome = run_stage(root, name, stages[name], composed)
        if outcome.failure:
            lacking |= dict.fromkeys(paths_of(stages[name], "outs"), name)
        outcomes.append(outcome)
        said = outcome.failure or f"{outcome.seconds:.1f} s"
        print(f"[{number}/{len(names)}] {name}: {said}", file=sys.stderr, flush=True)
    return outcomes


def table(scale: str, outcomes: Sequence[Outcome]) -> Table:
    """Seconds and peak memory of each stage."""
    cells = []
    for outcome in outcomes:
        ran = outcome.memory > 0
        memory = f"{outcome.memory / 1e9:.2f} GB" if ran else NONE
        cells.append([outcome.stage, f"{outcome.seconds:.1f} s" if ran else NONE, memory, outcome.failure or "ok"])
    return Table(f"One training step of each stage at scale={scale}", ["stage", "time", "peak memory", ""], cells)


def check(scale: str, clips: int, markdown: bool) -> int:
    """Prepares, trains, prints the table; 1 where a stage failed."""
    with tempfile.TemporaryDirectory(prefix="motionary-check-") as folder:
        root = copy_project(Path(folder) / "project")
        params = configure(root, scale, clips)
        names = training_stages(params, with_values(read_pipeline(root), params)["stages"])
        outcomes = run_stages(root, [PREPARES, *names])
    found = table(scale, outcomes)
    print(found.markdown() if markdown else found.text(), end="")
    failed = [outcome.stage for outcome in outcomes if outcome.failure]
    if failed:
        print(f"error: {', '.join(failed)}: failed at scale={scale}", file=sys.stderr)
    return int(bool(failed))


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; exit code 1 where a stage failed, 2 on a configuration that no stage would take."""
    parser = argparse.ArgumentParser(prog="python tests/check_paper.py", description=(__doc__ or "").split("\n\n")[1])
    parser.add_argument("--scale", default="paper", help="preset of conf/scale (default: %(default)s)")
    parser.add_argument("--clips", type=int, default=40, help="of the demo corpus (default: %(default)s)")
    parser.add_argument("--markdown", action="store_true", help="print the table for a page of docs")
    options = parser.parse_args(arguments)
    try:
        return check(options.scale, options.clips, options.markdown)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
