"""Training inside a stage: devices as configured, checkpoints in the project's cache, curves drawn and logged."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from typing import Any

from motionary.corpus.batches import Batches, Dataset
from motionary.corpus.context import Context
from motionary.language import word_vectors
from motionary.nn.layers import load_word_vectors, seeded
from motionary.pipeline.learning_curves import draw_curves, write_curves
from motionary.pipeline.stage import Stage
from motionary.systems.io import CONFIG_FILE, Trained, build_model
from motionary.systems.registry import find
from motionary.systems.serving import filled
from motionary.training.devices import make_fabric, set_threads
from motionary.training.loop import History, fit
from motionary.training.settings import TrainSettings

VALIDATION_BATCH = 64


def trained_inputs(stage: Stage) -> Trained:
    """What the stage's system needs of other systems, as inputs of the stage: each by its role (`registry.filled`)."""
    trained = Trained(stage.workspace.root / "models")

    def section(name: str) -> Mapping[str, Any]:
        """The stage's own section, or what another system was trained with."""
        if name == stage.name:
            return stage.section
        return trained.config(name) if (trained.path(name) / CONFIG_FILE).is_file() else {}

    roles = filled(stage.name, section)
    for role in find(stage.name).needs:
        trained.names[role] = roles[role]
        stage.input(f"models/{roles[role]}")
    return trained


def build(stage: Stage, context: Context, seed: int | None = None, **more: Any) -> Any:
    """A fresh model of the stage's system, made from its section and `more`, from the stage's seed or another; word
    embeddings start from the word vectors of the section `language` where the stage reads it."""
    trained = trained_inputs(stage)
    with seeded(stage.seed if seed is None else seed):
        model = build_model(stage.name, {**stage.model(), **more}, context, trained)
    if "language" in stage.owned:
        load_word_vectors(model, word_vectors(context.vocabulary, stage.values["language"]["word_vectors"]))
    return model


def train(
    stage: Stage, model, data: Dataset, validation: Dataset, settings: TrainSettings, length_sorted: bool = False
) -> History:
    """Trains the one model of `stage`; see `train_each`."""
    return train_each(stage, {"": model}, data, validation, settings, length_sorted)[""]


def train_each(
    stage: Stage,
    models: Mapping[str, Any],
    data: Dataset,
    validation: Dataset,
    settings: TrainSettings,
    length_sorted: bool = False,
    seeds: Mapping[str, int] | None = None,
) -> dict[str, History]:
    """Trains the models of `stage` one after another and leaves them on the CPU in eval mode.

    Args:
        stage: the running stage: its inputs must have been asked for before, since they name the checkpoints.
        models: each a :class:`motionary.systems.trainable.Trainable`, by the name that its checkpoint and curves bear;
            "" is the stage's.
        data: the training split.
        validation: what early stopping and the validation curves watch.
        settings: of the loop.
        length_sorted: put items of similar length into one batch (see corpus.batches.Batches).
        seeds: of each model's training; None is the stage's for all.

    Returns:
        what happened, by the same names. Under ``torchrun`` only the first process returns; the others end here, since
        it writes what follows.
    """
    set_threads(int(stage.values["threads"]))
    fabric = make_fabric(stage.values["device"], stage.values["precision"])
    if fabric.global_rank == 0:
        stage.forget_finished()
    settings = settings.over(getattr(data, "starts_in_all", len(data)), fabric.world_size)
    held = Batches(validation, min(settings.batch_size, VALIDATION_BATCH), shuffle=False)
    histories = {}
    for name, model in models.items():
        seed = seeds[name] if seeds else stage.seed
        batches = Batches(
            data,
            settings.batch_size,
            seed,
            drop_last=True,
            rank=fabric.global_rank,
            world=fabric.world_size,
            length_sorted=length_sorted,
        )
        label = name or stage.name
        log = _logger(stage, name) if fabric.global_rank == 0 else None
        checkpoint = stage.cache / f"{label}.safetensors"
        histories[name] = fit(model, batches, held, settings, fabric, checkpoint, seed, log, label)
        model.to("cpu")
    if fabric.global_rank > 0:
        sys.exit(0)
    for name, history in histories.items():
        curves = _prefixed(name, "curves")
        write_curves(history, stage.figure_path(f"{curves}.csv"))
        if (drawn := draw_curves(history, name or stage.name)).axes:
            stage.figure(curves, drawn)
    return histories


def _prefixed(name: str, what: str) -> str:
    return f"{name}_{what}" if name else what


def _logger(stage: Stage, name: str) -> Callable[[int, dict[str, float]], None]:
    """Logs the values of one of the stage's models under its name."""
    return lambda step, values: stage.tracker.log(step, {_prefixed(name, key): v for key, v in values.items()})


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
