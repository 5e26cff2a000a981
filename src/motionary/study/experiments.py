"""What a study consists of: named experiments, each a set of overrides of the pipeline's configuration."""

from __future__ import annotations

import json
import re
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from motionary.errors import InputError
from motionary.pipeline.workspace import values_hash

_KEYS = {"why", "set", "vary", "times", "systems"}


@dataclass(frozen=True)
class Experiment:
    """One run of the pipeline.

    Attributes:
        name: the entry's name with its varied value; also that of the DVC experiment and of the folder of results.
        entry: name of the entry in the study.
        value: of what the entry varies, None where it varies nothing.
        why: what the entry is for.
        overrides: as behind ``dvc exp run -S``.
        systems: to evaluate, or stages that score on their own; only what these need is run.
        key: hash of the systems and of what their stages, and all before them, read of the configuration: results of
            another key are out of date.
        study: name of the study.
    """

    name: str
    entry: str
    value: Any
    why: str
    overrides: tuple[str, ...]
    systems: tuple[str, ...]
    key: str
    study: str = "study"

    def command(self) -> list[str]:
        """The DVC command that runs it, in a temporary copy, so that the workspace stays as it is."""
        sets = [part for override in self.overrides for part in ("--set-param", override)]
        targets = [scoring_stage(system) for system in self.systems]
        return [sys.executable, "-m", "dvc", "exp", "run", "--temp", "--name", self.reference, *sets, *targets]

    def shown(self) -> str:
        """The command as one would type it."""
        return shlex.join(["dvc", *self.command()[3:]])

    @property
    def reference(self) -> str:
        """Name of the DVC experiment."""
        return f"{self.study}-{self.name}-{self.key[:8]}"

    @property
    def folder(self) -> Path:
        """Where its reports lie, relative to the project."""
        return Path("reports") / self.study / self.name


def scoring_stage(system: str) -> str:
    """The DVC stage that scores a system: the one for all, or, for a name that ends in "_evaluation", itself."""
    return system if system.endswith("_evaluation") else f"evaluation@{system}"


@dataclass(frozen=True)
class Study:
    """All experiments in the order in which they run, and the pairs of (entry, system) to compare.

    A row that a system's report has of its own is compared as "system/row", as in "action_evaluation/plain". `name`
    is the file's without its ending.
    """

    experiments: tuple[Experiment, ...]
    compare: tuple[tuple[tuple[str, str], tuple[str, str]], ...]
    name: str = "study"

    @property
    def folder(self) -> Path:
        """Where its results lie, relative to the project."""
        return Path("reports") / self.name


def read_study(root: Path, path: Path, roots: Sequence[str] | None = None) -> Study:
    """Reads a file such as conf/study.yaml.

    Args:
        root: the project; ``root/conf`` composes every experiment.
        path: the YAML file: base, roots, experiments and compare. Results lie in a folder of its name, so that this is
            study.yaml or ends in _study.yaml.
        roots: data roots in place of the file's; relative ones start at `root`.

    Raises:
        InputError: an unreadable file or another name, an unknown key, an override that conf/ does not know, or a
            missing root.
    """
    if path.stem != "study" and not path.stem.endswith("_study"):
        raise InputError(path, path.name, "must be named study.yaml or NAME_study.yaml, as the folder of results is")
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
        base, entries = list(values["base"]), dict(values["experiments"])
    except (OSError, yaml.YAMLError, KeyError, TypeError, ValueError) as error:
        raise InputError(path, error, "must be YAML with base, roots, experiments and compare") from None
    base += _roots_override(root, values.get("roots", []) if roots is None else roots)
    for name, entry in entries.items():
        if unknown := set(entry) - _KEYS:
            raise InputError(f"{path}: {name}", sorted(unknown), f"unknown keys; known are {', '.join(sorted(_KEYS))}")
        if not entry.get("systems"):
            raise InputError(f"{path}: {name}.systems", entry.get("systems"), "must name the systems to evaluate")
        if len(entry.get("vary", {})) > 1:
            raise InputError(f"{path}: {name}.vary", entry["vary"], "must vary one key")
        if not isinstance(entry.get("why", ""), str):
            raise InputError(
                f"{path}: {name}.why", entry["why"], "must be a line of text; quote one that holds a colon"
            )
    compare = tuple(tuple(tuple(side) for side in pair) for pair in values.get("compare", []))
    for entry, system in (_side(path, pair, side) for pair in compare for side in pair):
        if entry not in entries or system.split("/")[0] not in entries[entry]["systems"]:
            raise InputError(f"{path}: compare", [entry, system], "must be an experiment above and one of its systems")
    pipeline = read_pipeline(root)
    rounds = max(len(_variants(entry)) for entry in entries.values())
    chosen = [
        replace(_experiment(root, pipeline, base, name, entry, *_variants(entry)[number]), study=path.stem)
        for number in range(rounds)
        for name, entry in entries.items()
        if number < len(_variants(entry))
    ]
    return Study(tuple(chosen), compare, path.stem)  # type: ignore[arg-type]


def _side(path: Path, pair: Sequence[Any], side: Sequence[str]) -> tuple[str, str]:
    if len(pair) != 2 or len(side) != 2:
        raise InputError(f"{path}: compare", pair, "must be a pair of [experiment, system]")
    return side[0], side[1]


def compose(root: Path, overrides: Sequence[str]) -> dict[str, Any]:
    """The pipeline's configuration with `overrides`, as DVC composes it; InputError names a wrong override."""
    from hydra import compose as hydra_compose
    from hydra import initialize_config_dir
    from hydra.errors import HydraException
    from omegaconf import OmegaConf

    try:
        with initialize_config_dir(str((root / "conf").resolve()), version_base="1.3"):
            config = hydra_compose("config", list(overrides))
    except HydraException as error:
        raise InputError("override", " ".join(overrides), str(error).splitlines()[0]) from None
    return OmegaConf.to_container(config, resolve=True)  # type: ignore[return-value]


def _roots_override(root: Path, roots: Sequence[str]) -> list[str]:
    """The roots as given: conf/ makes them findable from the temporary copies in which experiments run."""
    for folder in roots:
        if not (root / folder).is_dir():
            raise InputError("roots", root / folder, "must be a folder of motions; give your own with --roots")
    quoted = ",".join(f"'{folder}'" for folder in roots)
    return [f"data.roots=[{quoted}]"] if roots else []


def _variants(entry: Mapping[str, Any]) -> list[tuple[str | None, Any]]:
    """(key, value) of each run of an entry."""
    return [(key, value) for key, values in entry.get("vary", {}).items() for value in values] or [(None, None)]


def _experiment(
    root: Path,
    pipeline: Mapping[str, Any],
    base: list[str],
    name: str,
    entry: Mapping[str, Any],
    key: str | None,
    value: Any,
):
    overrides = [*base, *entry.get("set", [])]
    if key is not None:
        overrides.append(f"{key}={value}")
    config = compose(root, overrides)
    for scaled, factor in entry.get("times", {}).items():
        section, last = _place(config, scaled)
        section[last] = round(factor * section[last])
        overrides.append(f"{scaled}={section[last]}")
    systems = tuple(entry["systems"])
    listed = [system for system in systems if scoring_stage(system) != system]
    if not set(listed) <= set(config["evaluation"]["systems"]):
        overrides.append(f"evaluation.systems=[{','.join(listed)}]")
        config = compose(root, overrides)
    read = {section: config[section] for section in sections_read(with_values(pipeline, config), systems)}
    if "evaluation" in read:  # which others could be scored changes nothing: a new system leaves old results valid
        read["evaluation"] = {name: value for name, value in read["evaluation"].items() if name != "systems"}
    full = name if key is None else f"{name}-{value}"
    return Experiment(
        full, name, value, entry.get("why", ""), tuple(overrides), systems, values_hash([read, sorted(systems)])
    )


def read_pipeline(root: Path) -> dict[str, Any]:
    """The contents of the project's dvc.yaml."""
    return yaml.safe_load((root / "dvc.yaml").read_text(encoding="utf-8"))


def with_values(pipeline: Mapping[str, Any], config: Mapping[str, Any]) -> dict[str, Any]:
    """The contents of dvc.yaml as DVC resolves them: one stage for each item of a `foreach`, called "stage@item", and
    each ${key.of.the.configuration} replaced by its value."""
    stages: dict[str, Any] = {}
    for name, stage in pipeline["stages"].items():
        if "foreach" not in stage:
            stages[name] = _resolved(stage, config)
            continue
        items = _value(config, stage["foreach"].strip("${}"))
        keyed = items if isinstance(items, Mapping) else {item: item for item in items or []}
        for key, item in keyed.items():
            stages[f"{name}@{key}"] = _resolved(stage["do"], {**config, "key": key, "item": item})
    return {**pipeline, "stages": stages}


def _resolved(stage: Mapping[str, Any], config: Mapping[str, Any]) -> dict[str, Any]:
    """A stage with the configuration's values; a name of dvc.yaml's own stays."""

    def value(found: re.Match[str]) -> str:
        """What the configuration holds at the place, or the text as it was."""
        place = _value(config, found.group(1))
        return place if isinstance(place, str) else found.group(0)

    return json.loads(re.sub(r"\$\{([\w.\[\]]+)\}", value, json.dumps(stage)))


def _value(config: Mapping[str, Any], key: str) -> Any:
    """The value of a dotted key, where an item of a list is called as in "item[0]"; None where there is none."""
    place: Any = config
    for part in re.findall(r"\w+", key):
        if isinstance(place, Mapping):
            place = place.get(part)
        elif isinstance(place, Sequence) and not isinstance(place, str) and part.isdigit() and int(part) < len(place):
            place = place[int(part)]
        else:
            return None
    return place


def stages_before(pipeline: Mapping[str, Any], systems: Sequence[str]) -> list[Mapping[str, Any]]:
    """The stages that score `systems` and every stage that they need, those needed first.

    Code, which DVC hashes at every run, is none of them: it is not part of the configuration.

    Args:
        pipeline: as `with_values` leaves it.
        systems: names of evaluated systems, or of stages that score on their own.
    """
    stages = pipeline["stages"]
    writer = {out: name for name, stage in stages.items() for out in paths_of(stage, "outs", "metrics")}
    order: list[str] = []

    def visit(name: str) -> None:
        """Puts what a stage needs before it."""
        for path in paths_of(stages[name], "deps"):
            if path in writer:
                visit(writer[path])
        if name not in order:
            order.append(name)

    for system in systems:
        visit(scoring_stage(system))
    return [stages[name] for name in order]


def paths_of(stage: Mapping[str, Any], *kinds: str) -> list[str]:
    """The paths of a stage of dvc.yaml that are listed as deps, outs or metrics, with or without settings."""
    entries = [entry for kind in kinds for entry in stage.get(kind, [])]
    return [entry if isinstance(entry, str) else next(iter(entry)) for entry in entries]


def sections_read(pipeline: Mapping[str, Any], systems: Sequence[str]) -> list[str]:
    """Sections of the configuration that scoring `systems`, and all before it, reads (arguments of `stages_before`).

    Not `source`: where a clip lies changes no number.
    """
    keys = {key for stage in stages_before(pipeline, systems) for key in stage.get("params", [])}
    return sorted({key.split(".")[0] for key in keys} - {"source"})


def _place(config: dict[str, Any], key: str) -> tuple[dict[str, Any], str]:
    """The section that holds the number named by a dotted key, and its own name there."""
    *path, last = key.split(".")
    section: Any = config
    for part in path:
        section = section.get(part) if isinstance(section, dict) else None
    if not isinstance(section, dict) or not isinstance(section.get(last), int | float):
        raise InputError("times", key, "must be a number of the configuration")
    return section, last
