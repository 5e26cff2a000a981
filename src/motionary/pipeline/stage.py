"""What every file in stages/ shares: configuration in, inputs, training, declared outputs, tracking."""

from __future__ import annotations

import functools
import os
import shutil
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from motionary.errors import InputError, check_whole
from motionary.pipeline.code import code_hash, code_name
from motionary.pipeline.journal import JOURNALS
from motionary.pipeline.leftovers import Alone, remove_unfinished, remove_unfinished_checkpoints
from motionary.pipeline.short import short
from motionary.pipeline.sweep import own_lines
from motionary.pipeline.tracking import Tracker, committed_params, numbers, run_name
from motionary.pipeline.workspace import Workspace, content_hash, values_hash
from motionary.systems.renamed import refuse_old_names
from motionary.systems.serving import served_by
from motionary.training.settings import DATA_KEYS, SEED_KEY, TrainSettings, model_keys, settings_of

T = TypeVar("T")
FINISHED = "finished"  # marks the checkpoints of a run that ended well
SHARED = ("seed", "device", "precision", "threads", "scale")


class Stage:
    """One run of one pipeline stage.

    Args:
        name: of the stage: its section in the configuration, its MLflow experiment, its report.
        config: the composed configuration.
        root: folder of the project that holds the stage file.
        sections: further sections of the configuration that the stage reads, or dotted keys of them.
        label: distinguishes runs of one stage (`evaluation` of each system).
    """

    def __init__(
        self, name: str, config: DictConfig, root: Path, sections: Sequence[str] = (), label: str | None = None
    ):
        self.name, self.label = name, label
        self.values: dict[str, Any] = OmegaConf.to_container(config, resolve=True)  # type: ignore[assignment]
        self.owned = (name, *sections)
        hydra = HydraConfig.get()
        sweeping = hydra.mode == RunMode.MULTIRUN
        folder = Path(hydra.runtime.output_dir)
        self.workspace = Workspace.find(root, folder)
        self._alone = self._take_over(root)
        self.section: dict[str, Any] = self.values.get(name, {})
        self.seed = self._own_seed()
        shared = [key for key in SHARED if key != SEED_KEY or SEED_KEY not in self.section]
        refuse_old_names(name, self.section)
        refuse_foreign_overrides(hydra.overrides.task, name, (*self.owned, *shared))
        if "steps" in self.section:
            self.training()  # a bad value is said before anything is read
        self.data = {key: self.section[key] for key in DATA_KEYS if key in self.section}
        # As it is now: edits while the stage runs are not what it ran.
        self.code = code_hash(root, code_name(name, label), self.values)
        self._sweep = Path(hydra.sweep.dir).resolve() if sweeping else None
        self._inputs: dict[str, Path] = {}
        self._hashed: tuple[tuple[str, ...], str] | None = None
        self._tracker: Tracker | None = None

    def _take_over(self, root: Path) -> Alone | None:
        """Under DVC: waits for the same stage of a killed run, and removes what killed ones left of its outputs."""
        running = os.environ.get("DVC_STAGE", "").rsplit(":", 1)[-1]
        if not running or int(os.environ.get("RANK", "0")):
            return None
        alone = Alone(root, running)
        remove_unfinished(root, running)
        return alone

    def _read(self, *further: str) -> dict[str, Any]:
        """What the stage owns of the configuration, and `further` keys, by name; None where there is none."""
        composed = OmegaConf.create(self.values)
        found = {name: OmegaConf.select(composed, name) for name in (*self.owned, *further)}
        return OmegaConf.to_container(OmegaConf.create(found))  # type: ignore[return-value]

    def _own_seed(self) -> int:
        """The section's own seed where it has one (the judge's), else the pipeline's."""
        own = SEED_KEY in self.section
        seed = self.section[SEED_KEY] if own else self.values[SEED_KEY]
        check_whole(f"{self.name}.{SEED_KEY}" if own else SEED_KEY, seed, 0)
        return seed

    # Inputs -----------------------------------------------------------------------------------------------------

    def input(self, relative: str) -> Path:
        """An upstream output, remembered for the hash of inputs; missing, the error names the stage to run."""
        self._inputs[relative] = self.workspace.input(relative)
        return self._inputs[relative]

    def serving(self, *systems: str) -> Path:
        """The folder of trained models, with these systems and all that they ask for when they answer as inputs."""
        for name in served_by(systems, lambda name: self.values.get(name) or {}):
            self.input(f"models/{name}")
        return self.workspace.root / "models"

    def training(self) -> TrainSettings:
        """The training settings of the stage's section."""
        return settings_of(self.section, self.name)

    def model(self) -> dict[str, Any]:
        """The model's own keys of the stage's section."""
        return model_keys(self.section)

    # Work -------------------------------------------------------------------------------------------------------

    @property
    def inputs_hash(self) -> str:
        """Hash of the contents of every input asked for so far, read once."""
        known = tuple(self._inputs)
        if self._hashed is None or self._hashed[0] != known:
            self._hashed = known, content_hash(*self._inputs.values())
        return self._hashed[1]

    @property
    def cache(self) -> Path:
        """Folder for checkpoints of exactly these parameters, inputs and code, under the real root."""
        own = self._read("precision") | {"seed": self.seed}
        key = values_hash([own, self.inputs_hash, self.code, os.environ.get("WORLD_SIZE", "1")])
        return self.workspace.home / ".cache" / self.name / key[:16]

    def forget_finished(self) -> None:
        """Removes the checkpoints of this stage's other trainings that ended well; a sweep's jobs keep each other's.

        Halves of checkpoints that a killed process was writing go, too.
        """
        remove_unfinished_checkpoints(self.cache)
        if self._sweep is None:
            for mark in self.cache.parent.glob(f"*/{FINISHED}"):
                if mark.parent != self.cache and not any(mark.parent.glob(JOURNALS)):  # rows that MLflow lacks
                    shutil.rmtree(mark.parent, ignore_errors=True)

    @property
    def tracker(self) -> Tracker:
        """The MLflow run, opened at first use."""
        if self._tracker is None:
            tags = {
                "dvc.stage": os.environ.get("DVC_STAGE", ""),
                "dvc.exp_name": os.environ.get("DVC_EXP_NAME", ""),
                "hash.params": values_hash(self._read() | {"seed": self.seed}),
                "hash.inputs": self.inputs_hash,
                "hash.code": self.code,
                "mlflow.source.name": f"stages/{self.name}.py",
                "mlflow.source.type": "LOCAL",
            }
            params = self._read(*SHARED)
            name = self._run_name(params, tags["dvc.exp_name"])
            self._tracker = Tracker(self.workspace.home, self.name, name, params, tags, self.cache, self._sweep)
        return self._tracker

    def _run_name(self, params: Mapping[str, Any], experiment: str) -> str:
        """What differs from other runs of the stage, as the dashboard shows it."""
        usual = committed_params(self.workspace.root)
        if usual.get("scale") != self.values.get("scale"):
            usual = {}  # another scale: nearly everything differs, and its name says so
        parts = (self.label or "", self.values["data"]["name"], str(self.values.get("scale", "")), experiment)
        return run_name(parts, self.name, params, {k: v for k, v in usual.items() if k != "scale"})

    # Outputs ----------------------------------------------------------------------------------------------------

    def publish(self, relative: str):
        """Context: a temporary folder that becomes the output when the block succeeds."""
        return self.workspace.publish(relative)

    def report(self, values: Mapping[str, Any], relative: str | None = None) -> None:
        """Writes the stage's report and logs its numbers.

        The stage's own (without `relative`) also names its code, by which the study knows results of other code, and
        leaves the few numbers that ``dvc metrics show`` prints in ``reports/short/``.
        """
        if relative is None:
            own = f"{self.name}/{self.label}.json" if self.label else f"{self.name}.json"
            relative, values = f"reports/{own}", {**values, "code": self.code}
            self.workspace.write_json(f"reports/short/{own}", short(values))
        path = self.workspace.write_json(relative, values)
        self.tracker.log(0, numbers(values))
        self.tracker.artifact(path)

    def figure_path(self, name: str) -> Path:
        """Path of a figure or curve of this stage; its folder exists."""
        folder = self.workspace.target / "reports" / "figures" / (self.label or self.name)
        folder.mkdir(parents=True, exist_ok=True)
        return folder / name

    def figure(self, name: str, figure) -> Path:
        """Saves a matplotlib figure as PNG and logs it."""
        path = self.figure_path(f"{name}.png")
        figure.savefig(path, dpi=110, bbox_inches="tight")
        self.tracker.artifact(path, "figures")
        return path

    def __enter__(self) -> Stage:
        return self

    def __exit__(self, kind, error, trace) -> None:
        if self._tracker is not None:
            self._tracker.close(failed=kind is not None)
            if kind is None and self.cache.is_dir():
                (self.cache / FINISHED).touch()
        if self._alone is not None:
            self._alone.release()


def refuse_foreign_overrides(overrides: Sequence[str], stage: str, read: Sequence[str]) -> None:
    """An override of a key that the stage does not read would do nothing: InputError.

    Args:
        overrides: as Hydra takes them.
        stage: name of the stage, for the message.
        read: sections, and dotted keys, that it reads.
    """
    for override in overrides:
        key = override.lstrip("+~").split("=", 1)[0]
        if not any(f"{key}.".startswith(f"{known}.") for known in read):
            raise InputError(key, override, f"stage {stage} reads only {', '.join(read)}; override it where it is used")


def run_stage(body: Callable[[DictConfig], None]) -> Callable[[DictConfig], None]:
    """Wraps a stage's body so that bad input ends in one line and exit code 2."""

    @functools.wraps(body)  # Hydra finds conf/ from the file of the wrapped function
    def main(config: DictConfig) -> None:
        """The body; bad input ends in one line and exit code 2."""
        with own_lines():
            try:
                body(config)
            except InputError as error:
                print(f"error: {error}", file=sys.stderr)
                sys.exit(2)

    return main
