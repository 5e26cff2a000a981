"""What the training loop can be told, and how a stage's flat configuration is divided."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

from motionary.errors import HEAVIEST, WIDEST, InputError, check_whole, configure

T = TypeVar("T")

PRECISIONS = ("auto", "32", "bf16-mixed")  # see training.devices.make_fabric
RATE_SCALES = ("none", "linear", "sqrt")  # see training.schedule.peak_factor

# The key of a stage's section that stands in for the pipeline's seed.
SEED_KEY = "seed"

# Keys of a stage's section that say how its training data is drawn (arguments of corpus.batches and corpus.labeled).
DATA_KEYS = ("window", "drop_unit", "balance", "every_caption", "uncaptioned")


@dataclass(frozen=True)
class TrainSettings:
    """Settings of :func:`motionary.training.loop.fit`, the same for every system; conf/shared/training.yaml explains
    each."""

    steps: int
    batch_size: int
    learning_rate: float
    weight_decay: float = 0.0
    max_grad_norm: float = 0.0
    warmup_steps: int = 0
    schedule: str = "cosine"
    scale_rate: str = "none"
    validate_every: int = 200
    patience: int = 0
    ema_decay: float = 0.0
    log_every: int = 20
    epochs: float = 0.0

    def over(self, items: int, world: int = 1) -> TrainSettings:
        """The settings for a training split of `items`, with `epochs` and a `validate_every` of 0 counted in steps of
        `world` processes. Only the last step's batch may reach beyond the last epoch."""
        epoch = items / (self.batch_size * world)
        steps = max(1, math.ceil(self.epochs * epoch)) if self.epochs else self.steps
        return replace(self, steps=steps, epochs=0.0, validate_every=self.validate_every or max(1, round(epoch)))

    def check(self, stage: str) -> None:
        """Raises InputError naming the first key that is out of range."""
        rules = {
            "steps": (1 <= self.steps <= 10**8, "must be in 1..100000000"),
            "batch_size": (1 <= self.batch_size <= WIDEST, f"must be in 1..{WIDEST}"),
            "learning_rate": (0 < self.learning_rate <= 100, "must be above 0, at most 100"),
            "weight_decay": (0 <= self.weight_decay <= HEAVIEST, f"must be in 0..{HEAVIEST}"),
            "max_grad_norm": (0 <= self.max_grad_norm <= HEAVIEST, f"must be in 0..{HEAVIEST} (0 is off)"),
            "warmup_steps": (0 <= self.warmup_steps <= 10**8, "must be in 0..100000000"),
            "schedule": (self.schedule in ("constant", "cosine"), "must be constant or cosine"),
            "scale_rate": (self.scale_rate in RATE_SCALES, f"must be one of {', '.join(RATE_SCALES)}"),
            "validate_every": (self.validate_every >= 0, "must not be negative (0 is once an epoch)"),
            "epochs": (0 <= self.epochs <= 10**6, "must be in 0..1000000 (0 counts in steps)"),
            "patience": (self.patience >= 0, "must not be negative (0 is off)"),
            "ema_decay": (0 <= self.ema_decay < 1, "must be in [0, 1) (0 is off)"),
            "log_every": (self.log_every >= 1, "must be at least 1"),
        }
        for key, (holds, rule) in rules.items():
            if not holds:
                raise InputError(f"{stage}.{key}", getattr(self, key), rule)


_TRAINING = {field.name for field in fields(TrainSettings)}


def settings_of(section: Mapping[str, Any], stage: str) -> TrainSettings:
    """The training settings among the keys of a stage's section, checked."""
    settings = configure(TrainSettings, {k: v for k, v in section.items() if k in _TRAINING}, stage)
    settings.check(stage)
    return settings


def check_precision(precision: Any) -> None:
    """Raises InputError unless `precision` is one of `PRECISIONS`; YAML reads 32 as a number."""
    if str(precision) not in PRECISIONS:
        raise InputError("precision", precision, f"must be one of {', '.join(PRECISIONS)}")


def check_data(section: Mapping[str, Any], stage: str) -> None:
    """Raises InputError for the first of `DATA_KEYS` in a stage's section that no corpus would allow."""
    if "window" in section:
        check_whole(f"{stage}.window", section["window"], 1)
    for key in {"drop_unit", "balance", "uncaptioned"} & section.keys():
        value = section[key]
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= 1:
            raise InputError(f"{stage}.{key}", value, "must be a number in 0..1")
    if not isinstance(value := section.get("every_caption", True), bool):
        raise InputError(f"{stage}.every_caption", value, "must be true or false")


def model_keys(section: Mapping[str, Any]) -> dict[str, Any]:
    """The model's own keys of a stage's section."""
    return {k: v for k, v in section.items() if k not in _TRAINING and k not in DATA_KEYS and k != SEED_KEY}
