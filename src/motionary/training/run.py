"""Training inside a stage: devices as configured, checkpoints in the project's cache, curves drawn and logged."""

from __future__ import annotations

import sys

from motionary.corpus.batches import Batches, Dataset
from motionary.training.curves import draw_curves, write_curves
from motionary.training.devices import make_fabric, set_threads
from motionary.training.loop import History, fit
from motionary.training.settings import TrainSettings
from motionary.training.stage import Stage

VALIDATION_BATCH = 64


def train(
    stage: Stage,
    model,
    data: Dataset,
    validation: Dataset,
    settings: TrainSettings,
    length_sorted: bool = False,
    name: str = "",
    seed: int | None = None,
    more: bool = False,
) -> History:
    """Trains `model` for `stage` and leaves it on the CPU in eval mode.

    Args:
        stage: the running stage: its inputs must have been asked for before, since they name the checkpoint.
        model: a :class:`motionary.training.loop.System`.
        data: the training split.
        validation: what early stopping and the validation curves watch.
        settings: of the loop.
        length_sorted: put items of similar length into one batch (see corpus.batches.Batches).
        name: distinguishes several models of one stage, also in its curves.
        seed: of this model's training; None is the stage's.
        more: the stage trains further models after this one.

    Under ``torchrun`` only the first process returns from the last training of a stage; the others end here, since it
    writes what follows.
    """
    set_threads(int(stage.values["threads"]))
    fabric = make_fabric(stage.values["device"], stage.values["precision"])
    first = fabric.global_rank == 0
    label, prefix = name or stage.name, f"{name}_" if name else ""
    seed = stage.seed if seed is None else seed
    batches = Batches(
        data,
        settings.batch_size,
        seed,
        drop_last=True,
        rank=fabric.global_rank,
        world=fabric.world_size,
        length_sorted=length_sorted,
    )

    def log(step: int, values: dict[str, float]) -> None:
        stage.tracker.log(step, {f"{prefix}{key}": value for key, value in values.items()})

    history = fit(
        model,
        batches,
        Batches(validation, min(settings.batch_size, VALIDATION_BATCH), shuffle=False),
        settings,
        fabric,
        checkpoint=stage.cache / f"{label}.safetensors",
        seed=seed,
        log=log if first else None,
        description=label,
    )
    model.to("cpu")
    if first:
        write_curves(history, stage.figure_path(f"{prefix}curves.csv"))
        stage.figure(f"{prefix}curves", draw_curves(history, label))
    elif not more:
        sys.exit(0)
    return history


def last_losses(history: History) -> dict[str, float]:
    """What a training stage reports of its own curves: last and best validation values, time and early stopping."""
    rows = history.validation or history.train
    best = min(rows, key=lambda row: row["loss"])
    return {
        "steps": int(history.train[-1]["step"]),
        "best_step": int(best["step"]),
        "best_validation_loss": round(best["loss"], 5),
        **{f"validation_{name}": round(value, 5) for name, value in rows[-1].items() if name != "step"},
        "stopped_early": int(history.stopped_early),
    }
