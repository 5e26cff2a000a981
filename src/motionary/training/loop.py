"""The one training loop. A system brings a loss; the loop brings devices, schedules, checkpoints and early stopping."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from lightning_fabric import Fabric
from torch import Tensor, nn
from tqdm import tqdm

from motionary.corpus.batches import Batch, Batches
from motionary.errors import InputError
from motionary.systems.trainable import Loss, Trainable
from motionary.training.averaging import WeightAverage
from motionary.training.checkpoint import newest, restore, save_checkpoint
from motionary.training.loading import moved_ahead
from motionary.training.schedule import peak_factor, rate
from motionary.training.settings import TrainSettings

_RUNAWAY = 1e4  # times the first loss: no training that learns comes near


@dataclass
class History:
    """Curves of one training: rows of {"step", name: value}, as logged."""

    train: list[dict[str, float]] = field(default_factory=list)
    validation: list[dict[str, float]] = field(default_factory=list)
    best_step: int = 0
    stopped_early: bool = False
    seconds: float = 0.0


def fit(
    model: Trainable,
    train: Batches,
    validation: Batches | None,
    settings: TrainSettings,
    fabric: Fabric,
    checkpoint: Path | None = None,
    seed: int = 0,
    log: Callable[[int, dict[str, float]], None] | None = None,
    description: str = "train",
    stop_after: int | None = None,
) -> History:
    """Trains `model` in place and leaves it in eval mode with the kept weights.

    Args:
        model: what is trained; frozen parts have ``requires_grad`` off.
        train: batches of this process; every epoch and step is a pure function of the seed.
        validation: batches for its `validate`, or None.
        settings: see :class:`TrainSettings`.
        fabric: devices and precision, from :func:`motionary.training.devices.make_fabric`.
        checkpoint: file to resume from where it exists and to write to; None keeps no checkpoint.
        seed: of dropout and sampling inside the loss.
        log: called with (step, values) for every logged row.
        description: label of the progress bar.
        stop_after: returns after this many steps in all as if killed just after a checkpoint (for tests).

    A killed run that is started again with the same arguments ends with the weights of an unbroken one.

    Raises:
        InputError: the loss is no number any more, or 10,000 times what it was at first.
    """
    return _Run(model, train, validation, settings, fabric, checkpoint, seed, log, description).run(stop_after)


class _Objective(nn.Module):
    """Computes a loss of the model that it holds, as its `forward`: what Fabric casts and distributes."""

    def __init__(self, model: Trainable):
        super().__init__()
        self.model = model

    def forward(self, compute: Callable[[], Loss]) -> Loss:
        """What `compute` gives."""
        # Not the batch itself: Fabric would round its features to the products' precision.
        return compute()


class _Run:
    """State of one call of :func:`fit`."""

    def __init__(
        self,
        model: Trainable,
        train: Batches,
        validation: Batches | None,
        settings: TrainSettings,
        fabric: Fabric,
        checkpoint: Path | None,
        seed: int,
        log: Callable[[int, dict[str, float]], None] | None,
        description: str,
    ):
        self.model, self.train, self.validation, self.settings = model, train, validation, settings
        self.fabric, self.checkpoint, self.seed, self.description = fabric, checkpoint, seed, description
        self.log = log or (lambda step, values: None)
        self.history = History()
        self.step, self.bad, self.best, self.stopped = 0, 0, math.inf, False
        groups = _groups(model, settings.learning_rate * peak_factor(settings, fabric.world_size))
        self.rates = [group["lr"] for group in groups]
        # Fused: one pass over the weights in place of ten, also on a CPU.
        optimizer = torch.optim.AdamW(groups, lr=settings.learning_rate, weight_decay=settings.weight_decay, fused=True)
        self.objective, self.optimizer = fabric.setup(_Objective(model), optimizer)
        self.parameters = [p for group in groups for p in group["params"]]
        self.average = WeightAverage(model, settings.ema_decay)
        self.kept: dict[str, Tensor] = {}

    def run(self, stop_after: int | None) -> History:
        """Trains from the checkpoint, or from the start, to the last step."""
        self._resume()
        started, settings = time.monotonic(), self.settings
        per_step = settings.batch_size * self.fabric.world_size
        bar = tqdm(
            total=settings.steps * per_step,
            initial=self.step * per_step,
            unit="item",
            desc=self.description,
            disable=self.fabric.global_rank > 0,
            mininterval=1.0,
            smoothing=0.05,
        )
        batches = moved_ahead(self._batches(), self.fabric.device)
        self.model.train()
        while self.step < settings.steps and not self.stopped:
            values = self._step(next(batches))
            bar.update(per_step)
            if self.step % settings.log_every == 0 or self.step == settings.steps:
                row = {name: float(value) for name, value in values.items()}
                bar.set_postfix(loss=f"{row['loss']:.4g}", refresh=False)
                self.history.train.append({"step": self.step, **row})
                self.log(self.step, {f"train/{name}": value for name, value in row.items()})
                self._check_loss(row["loss"])
            if self.step % settings.validate_every == 0 or self.step == settings.steps:
                self._validate()
                self.history.seconds += time.monotonic() - started
                started = time.monotonic()
                self._save()
            if stop_after is not None and self.step >= stop_after:
                break
        bar.close()
        batches.close()
        self._keep()
        return self.history

    def _check_loss(self, loss: float) -> None:
        """InputError where the training has run away: what it would end with is worth nothing."""
        first = self.history.train[0]
        if not math.isfinite(loss) or loss > _RUNAWAY * max(1.0, abs(first["loss"])):
            found = f"a loss of {loss:.3g} at step {self.step} ({first['loss']:.3g} at step {first['step']})"
            rule = "must not run away; lower learning_rate, set max_grad_norm or take precision=32"
            raise InputError(self.description, found, rule)

    def _batches(self) -> Iterator[Batch]:
        if len(self.train) == 0:
            raise ValueError("no training batch: the split holds fewer items than one batch")
        epoch, skip = divmod(self.step, len(self.train))
        while True:
            yield from self.train.epoch(epoch, start=skip)
            epoch, skip = epoch + 1, 0

    def _step(self, batch: Batch) -> dict[str, Tensor]:
        settings = self.settings
        progress = self.step / settings.steps
        factor = rate(settings, self.step)
        for group, peak in zip(self.optimizer.param_groups, self.rates, strict=True):
            group["lr"] = peak * factor
        generator = self._generator(self.step)
        loss, values = self.objective(lambda: self.model.loss(batch, progress, generator))
        self.fabric.backward(loss)
        if settings.max_grad_norm:
            values = {**values, "gradient": nn.utils.clip_grad_norm_(self.parameters, settings.max_grad_norm)}
        self.optimizer.step()
        self.optimizer.zero_grad(set_to_none=True)
        self.model.after_step(self.step, progress, generator)
        self.step += 1
        self.average.update(self.step)
        return {"loss": loss.detach(), "learning_rate": torch.tensor(self.rates[0] * factor), **values}

    def _generator(self, step: int) -> torch.Generator:
        """Of the step's draws. Dropout takes the global one, which is set here too: what a step draws depends on seed,
        step and process alone, so that a resumed training needs no state of either."""
        place = ((self.seed * 1_000_003 + step) * 4099 + self.fabric.global_rank) % 2**63
        torch.manual_seed(place)
        return torch.Generator(self.fabric.device).manual_seed(place)

    def _validate(self) -> None:
        if self.validation is None or len(self.validation) == 0:
            return
        with self.average.in_place():
            # Everywhere the first process's values: all must stop, and move a curriculum, at the same step.
            values = self.fabric.broadcast(validate(self.model, self.validation, self.fabric.device))
            if values["loss"] < self.best:
                self.best, self.bad, self.history.best_step = values["loss"], 0, self.step
                if self.settings.patience:
                    self.kept = {k: v.detach().clone() for k, v in self.model.state_dict().items()}
            else:
                self.bad += 1
        self.model.after_validation(values)
        self.history.validation.append({"step": self.step, **values})
        self.log(self.step, {f"validation/{name}": value for name, value in values.items()})
        if self.settings.patience and self.bad >= self.settings.patience:
            self.stopped = self.history.stopped_early = True
        self.model.train()

    def _save(self) -> None:
        if self.checkpoint is None or self.fabric.global_rank > 0:
            return
        parts = {"average": self.average.values, "kept": self.kept}
        extra = {f"{part}.{key}": value for part, values in parts.items() for key, value in values.items()}
        best = None if math.isinf(self.best) else self.best
        numbers = {"step": self.step, "bad": self.bad, "best": best, "stopped": self.stopped}
        numbers["history"] = vars(self.history)
        save_checkpoint(self.checkpoint, self.model, self.optimizer, extra, numbers)

    def _resume(self) -> None:
        """Continues from the checkpoint of the first process, whether or not the others see one."""
        path = self.checkpoint if self.fabric.global_rank == 0 else None
        found = self.fabric.broadcast(None if path is None else newest(path))
        if found is None:
            return
        tensors, numbers = found
        extra = restore(tensors, self.model, self.optimizer)
        self.step, self.bad, self.stopped = numbers["step"], numbers["bad"], numbers["stopped"]
        self.best = math.inf if numbers["best"] is None else numbers["best"]
        self.history = History(**numbers["history"])
        for name, value in extra.items():
            place, key = name.split(".", 1)
            (self.average.values if place == "average" else self.kept)[key] = value.to(self.fabric.device)

    def _keep(self) -> None:
        if self.kept:
            self.model.load_state_dict(self.kept)
        else:
            self.average.keep()
        self.model.eval()


@torch.no_grad()
def validate(model: Trainable, batches: Batches, device: torch.device | str) -> dict[str, float]:
    """Mean of ``model.validate`` over `batches`, weighted by items; the model is left in eval mode.

    In 32 bits at any precision of the training, as the model is used.
    """
    model.eval()
    sums: dict[str, float] = {}
    count = 0
    for batch in batches.epoch(0):
        batch = batch.to(device)
        items = len(batch.clip)
        for name, value in model.validate(batch).items():
            sums[name] = sums.get(name, 0.0) + float(value) * items
        count += items
    return {name: value / max(1, count) for name, value in sums.items()}


def _groups(model: Trainable, learning_rate: float) -> list[dict[str, Any]]:
    groups = [dict(group) for group in model.parameter_groups(learning_rate)]
    for group in groups:
        group["params"] = [p for p in group["params"] if p.requires_grad]
        group.setdefault("lr", learning_rate)
    return [group for group in groups if group["params"]]
