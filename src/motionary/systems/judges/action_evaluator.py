"""The judge of action2motion: GRU classifiers of actions, whose last layers are the features (thesis 3.3.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from motionary.corpus.batch import ActedBatch
from motionary.corpus.context import Context
from motionary.errors import WIDEST, InputError, check_range, check_share
from motionary.nn.padding import by_length, pad
from motionary.nn.poses import to_poses
from motionary.systems.io import load_model, model_hash
from motionary.systems.trainable import Loss, Trainable


@dataclass(frozen=True)
class ActionEvaluatorConfig:
    """Settings of the judges of actions (thesis 3.3.1); conf/action_evaluator.yaml explains each.

    Attributes:
        coarse, fine: names of the classes; fewer than two of a kind leave its classifier out.
    """

    coarse: tuple[str, ...] = ()
    fine: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ("coarse", "fine")
    width: int = 128
    dim: int = 30
    noise: float = 0.02
    label_smoothing: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.kinds, list | tuple) or not set(self.kinds) <= {"coarse", "fine"}:
            raise InputError("action_evaluator.kinds", self.kinds, "must be a list of some of coarse, fine")
        for kind in ("coarse", "fine", "kinds"):
            object.__setattr__(self, kind, tuple(getattr(self, kind)))
        check_range("action_evaluator", self, ("width", "dim"), 1, WIDEST)
        check_range("action_evaluator", self, ("noise",), 0, 100)
        check_share("action_evaluator", self, ("label_smoothing",))


class _Classifier(nn.Module):
    """Poses (B, T, P) and frames (B,) -> features (B, dim) -> logits (B, classes)."""

    def __init__(self, inputs: int, classes: int, config: ActionEvaluatorConfig):
        super().__init__()
        self.read = nn.Linear(inputs, config.width)
        self.unit = nn.GRU(config.width, config.width, 2, batch_first=True)
        self.features = nn.Linear(config.width, config.dim)
        self.classes = nn.Linear(config.dim, classes)

    def forward(self, poses: Tensor, frames: Tensor) -> tuple[Tensor, Tensor]:
        """Logits and features, from the state after the last valid frame: padding changes nothing."""
        states, _ = self.unit(self.read(poses))
        last = states[torch.arange(len(frames), device=frames.device), frames - 1]
        features = torch.tanh(self.features(last))
        return self.classes(features), features


class ActionEvaluator(Trainable):
    """One classifier for the coarse actions and one for the fine ones, without anything in common."""

    def __init__(self, config: ActionEvaluatorConfig, context: Context):
        super().__init__()
        self.config, self.context = config, context
        self.branches = nn.ModuleDict()
        for kind, names in (("coarse", config.coarse), ("fine", config.fine)):
            if kind in config.kinds and len(names) >= 2:
                self.branches[kind] = _Classifier(3 * len(context.skeleton), len(names), config)

    def forward(self, kind: str, joints: Tensor, frames: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (B, classes) and features (B, dim) of joints (B, T, J, 3), by the classifier of a kind."""
        if kind not in self.branches:
            raise InputError("action_evaluator", kind, "was not trained: the corpus names fewer than two such actions")
        return self.branches[kind](to_poses(joints, self.context.fps), frames)

    def loss(self, batch: ActedBatch, progress: float, generator: torch.Generator) -> Loss:
        """Sum of both cross-entropies over the items whose label is known, with accuracies as logs."""
        poses = to_poses(batch.joints, self.context.fps)
        if self.training and self.config.noise:
            noise = torch.randn(poses.shape, generator=generator, device=poses.device)
            poses = poses + self.config.noise * noise
        smoothing = self.config.label_smoothing if self.training else 0.0
        total, logs = poses.new_zeros(()), {}
        for kind, labels in (("coarse", batch.action), ("fine", batch.fine)):
            known = labels >= 0
            if kind in self.branches and bool(known.any()):
                logits, _ = self.branches[kind](poses[known], batch.frames[known])
                total = total + F.cross_entropy(logits, labels[known], label_smoothing=smoothing)
                logs[kind] = (logits.detach().argmax(-1) == labels[known]).float().mean()
        return total, logs


class ActionJudge:
    """Trained classifiers, for motions of any length and number.

    Args:
        model: the classifiers.
        hash: names their weights.
        device: where to compute.
        batch_size: items of a forward pass.
    """

    def __init__(self, model: ActionEvaluator, device: str = "cpu", batch_size: int = 256, hash: str = ""):
        self.model, self.hash = model.to(device).eval(), hash
        self.device, self.batch_size = device, batch_size

    @classmethod
    def open(cls, folder: Path, device: str = "cpu") -> ActionJudge:
        """The trained classifiers of a folder."""
        return cls(cast(ActionEvaluator, load_model(folder, device)), device, hash=model_hash(folder))

    @property
    def labels(self) -> dict[str, tuple[str, ...]]:
        """Class names of each classifier that was trained."""
        return {kind: getattr(self.model.config, kind) for kind in self.model.branches}

    @torch.no_grad()
    def judge(self, motions: Sequence[np.ndarray], kind: str = "coarse") -> tuple[np.ndarray, np.ndarray]:
        """Logits (N, classes) and features (N, dim) of motions, each joints (T, J, 3) in metres that start above the
        origin and face +z."""
        found: list[tuple[np.ndarray, np.ndarray]] = [(np.zeros(0), np.zeros(0))] * len(motions)
        for rows in by_length([len(m) for m in motions], self.batch_size):
            flat, frames = pad([motions[i].reshape(len(motions[i]), -1) for i in rows])
            answer = self.model(kind, flat.unflatten(-1, (-1, 3)).to(self.device), frames.to(self.device))
            for row, *values in zip(rows, *(part.cpu().numpy() for part in answer), strict=True):
                found[row] = (values[0], values[1])
        return np.stack([logits for logits, _ in found]), np.stack([features for _, features in found])
