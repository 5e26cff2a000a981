"""Seeds, splits, controls, ablations and baselines as DVC experiments: ``python -m motionary.study``.

Every experiment runs in a temporary copy of the project (the workspace and its results stay), shares unchanged stages
with all others through DVC's run cache, and leaves its reports in ``reports/study/<name>/`` (those of another file with
``--study``, in a folder of its name). A study that was killed
goes on where it stopped: whole experiments by these folders, whole stages by the run cache, and inside a training by
its checkpoint.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from motionary.errors import InputError
from motionary.files import atomic_folder, write_bytes
from motionary.pipeline import guard
from motionary.pipeline.code import code_hash
from motionary.study.compare import comparisons, measured_all, study_tables
from motionary.study.experiments import (
    Experiment,
    Study,
    compose,
    paths_of,
    read_pipeline,
    read_study,
    stages_before,
    with_values,
)

RECORD = "experiment.json"


def needed_reports(pipeline: Mapping[str, Any], systems: Sequence[str]) -> list[str]:
    """The reports that evaluating `systems` writes, upstream stages first (arguments of `stages_before`)."""
    written = [path for stage in stages_before(pipeline, systems) for path in paths_of(stage, "outs")]
    return [path for path in written if path.startswith("reports/") and path.endswith(".json")]


def is_done(root: Path, experiment: Experiment) -> bool:
    """Whether the results of exactly this configuration lie in its folder."""
    try:
        record = json.loads((root / experiment.folder / RECORD).read_text())
    except (OSError, ValueError):
        return False
    return record.get("key") == experiment.key


def is_current(root: Path, experiment: Experiment, code: Callable[[str], str]) -> bool:
    """Whether the reports of an experiment that is done name the `code` that its stages have now."""
    for path in (root / experiment.folder).rglob("*.json"):
        stage = f"evaluation@{path.stem}" if path.parent.name == "evaluation" else path.stem
        named = json.loads(path.read_text()).get("code")
        if named is not None and named != code(stage):
            return False
    return True


def run_experiment(root: Path, experiment: Experiment) -> bool:
    """Runs one experiment with DVC and collects its reports; False where DVC failed (it has said why)."""
    binaries = str(Path(sys.executable).parent)
    environment = {**os.environ, "PATH": os.pathsep.join((binaries, os.environ.get("PATH", "")))}
    # A left-over of the same name and configuration would stop DVC at the very end; nothing of value is lost.
    remove = [sys.executable, "-m", "dvc", "exp", "remove", "--quiet", experiment.reference]
    subprocess.run(remove, cwd=root, env=environment, capture_output=True, check=False)
    if guarded(experiment.command(), root, environment):
        return False
    pipeline = with_values(read_pipeline(root), compose(root, experiment.overrides))
    collect(root, experiment, needed_reports(pipeline, experiment.systems), experiment_reader(root, experiment))
    return True


def guarded(command: Sequence[str], root: Path, environment: Mapping[str, str]) -> int:
    """Exit code of a command whose processes end with this one, however it ends."""
    process = guard.start(list(command), root, dict(environment))
    assert process.stdin is not None
    try:
        return process.wait()
    finally:
        process.stdin.close()  # where this is interrupted, the guard interrupts them
        process.wait()


def experiment_reader(root: Path, experiment: Experiment) -> Callable[[str], str]:
    """A function that reads a file, by its path in the project, as the finished experiment left it."""
    from dvc.api import DVCFileSystem

    files = DVCFileSystem(str(root), rev=experiment.reference)
    return lambda path: str(files.read_text(path, encoding="utf-8"))


def collect(root: Path, experiment: Experiment, reports: Sequence[str], read: Callable[[str], str]) -> None:
    """Copies an experiment's reports to its folder, which appears whole or not at all."""
    record = {
        "key": experiment.key,
        "overrides": experiment.overrides,
        "systems": experiment.systems,
        "dvc_experiment": experiment.reference,
    }
    with atomic_folder(root / experiment.folder) as folder:
        for path in reports:
            target = folder / Path(path).relative_to("reports")
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(read(path), encoding="utf-8")
        (folder / RECORD).write_text(json.dumps(record, indent=1) + "\n")


def write_results(root: Path, study: Study) -> str:
    """Writes table.md and study.json of the study's folder, of what is done so far; returns the tables as Markdown."""
    done = [e for e in study.experiments if is_done(root, e)]
    runs = {e.name: measured_all(root / e.folder, e.systems) for e in done}
    missing = [e for e in study.experiments if e not in done]
    code = cache(lambda stage: code_hash(root, stage))
    older = [e for e in done if not is_current(root, e, code)]
    found = comparisons(study, runs)
    text = "\n".join(table.markdown() for table in study_tables(study, runs, found))
    if missing:
        text += f"\nNot run yet: {', '.join(_grouped(missing))}.\n"
    if older:
        text += f"\nRun with other code than the present (--again runs them anew): {', '.join(_grouped(older))}.\n"
    experiments = {
        e.name: {
            "why": e.why,
            "overrides": e.overrides,
            "values": {s: {name: value._asdict() for name, value in of.items()} for s, of in runs[e.name].items()},
        }
        for e in done
    }
    summary = {"experiments": experiments, "differences": found, "missing": [e.name for e in missing]}
    write_bytes(root / study.folder / "table.md", text)
    write_bytes(root / study.folder / "study.json", json.dumps(summary, indent=1) + "\n")
    return text


def _grouped(experiments: Sequence[Experiment]) -> list[str]:
    """Each entry once, with its values in brackets."""
    values: dict[str, list[str]] = {}
    for e in experiments:
        values.setdefault(e.entry, []).extend([] if e.value is None else [str(e.value)])
    return [f"{entry} ({', '.join(found)})" if found else entry for entry, found in values.items()]


def _chosen(study: Study, only: str | None) -> list[Experiment]:
    if only is None:
        return list(study.experiments)
    names = [name.strip() for name in only.split(",")]
    for name in names:
        if name not in {n for e in study.experiments for n in (e.name, e.entry)}:
            known = ", ".join(dict.fromkeys(e.entry for e in study.experiments))
            raise InputError("--only", name, f"must be among {known}, or one run of them, as --list shows")
    return [e for e in study.experiments if e.name in names or e.entry in names]


def _run_all(root: Path, study: Study, chosen: Sequence[Experiment], again: bool) -> int:
    failed = []
    for number, experiment in enumerate(chosen, 1):
        label = f"[{number}/{len(chosen)}] {experiment.name}"
        if is_done(root, experiment) and not again:
            print(f"{label}: done before")
            continue
        print(f"{label}: {experiment.why}\n  {experiment.shown()}", flush=True)
        if not run_experiment(root, experiment):
            print(f"error: {experiment.name}: dvc failed; run it again with --only {experiment.name}", file=sys.stderr)
            failed.append(experiment.name)
        write_results(root, study)
    print(write_results(root, study), end="")
    return int(bool(failed))


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs what is not done yet and prints the tables; exit code 1 where an experiment failed, 2 on bad input."""
    parser = argparse.ArgumentParser(prog="python -m motionary.study", description=__doc__)
    parser.add_argument("--list", action="store_true", help="name every experiment and say which are done")
    parser.add_argument("--dry", action="store_true", help="print the commands and run nothing")
    parser.add_argument("--table", action="store_true", help="only write and print the tables of what is done")
    parser.add_argument("--only", metavar="NAME,...", help="these experiments (main, or main-0 for one run of it)")
    parser.add_argument("--again", action="store_true", help="run done ones too (unchanged stages are not repeated)")
    parser.add_argument("--roots", nargs="+", metavar="FOLDER", help="data roots in place of the study's")
    parser.add_argument(
        "--study",
        type=Path,
        default=Path("conf/study.yaml"),
        help="what to run (conf/study.yaml; conf/action_study.yaml)",
    )
    options = parser.parse_args(arguments)
    root = Path.cwd()
    try:
        if not (root / "conf" / "config.yaml").exists():
            raise InputError(root, "no conf/config.yaml", "run this in the project's root")
        study = read_study(root, root / options.study, options.roots)
        chosen = _chosen(study, options.only)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if options.list:
        width = max(len(e.name) for e in chosen)
        for e in chosen:
            print(f"{e.name:{width}}  {'done' if is_done(root, e) else '-   '}  {e.why}")
    elif options.dry:
        print("\n".join(e.shown() for e in chosen if options.again or not is_done(root, e)))
    elif options.table:
        print(write_results(root, study), end="")
    else:
        return _run_all(root, study, chosen, options.again)
    return 0


if __name__ == "__main__":
    sys.exit(main())
