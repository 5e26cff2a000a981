"""The judges of stylization: a style classifier and a content classifier (thesis 5.3, "Metrics")."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from motionary.corpus.batch import LabeledBatch
from motionary.corpus.context import Context
from motionary.errors import WIDEST, InputError, check_range, check_share, check_values
from motionary.features import UNIT
from motionary.nn.convolutions import Down, ResBlock, coarser, keep
from motionary.nn.layers import Normalizer, length_mask
from motionary.nn.padding import by_length, pad
from motionary.nn.precision import full_precision, widened
from motionary.systems.io import load_model, model_hash
from motionary.systems.trainable import Trainable


@dataclass(frozen=True)
class StyleEvaluatorConfig:
    """Settings of the judges of stylization; conf/style_evaluator.yaml explains each.

    Attributes:
        trained: False where the corpus has no style labels; such an evaluator answers nothing.
    """

    width: int = 128
    dim: int = 64
    dropout: float = 0.1
    noise: float = 0.1
    group_dropout: float = 0.2
    label_smoothing: float = 0.1
    scale: float = 16.0
    trained: bool = True

    def __post_init__(self) -> None:
        check_range("style_evaluator", self, ("width", "dim"), 1, WIDEST)
        check_values("style_evaluator", self, ("scale",), lambda v: 0 < v <= 10_000, "must be above 0, at most 10000")
        shares = ("dropout", "group_dropout", "label_smoothing")
        check_share("style_evaluator", self, shares)
        check_range("style_evaluator", self, ("noise",), 0, 100)


class Classifier(nn.Module):
    """Normalized features (B, D, T) and their mask -> features (B, dim) on the unit sphere -> logits (B, classes).

    Two strided convolutions, two residual blocks, then mean and deviation over time: any length, one answer.
    """

    def __init__(self, inputs: int, classes: int, config: StyleEvaluatorConfig):
        super().__init__()
        width = config.width
        self.scale = config.scale
        self.downs = nn.ModuleList([Down(inputs, width), Down(width, width)])
        self.blocks = nn.ModuleList([ResBlock(width), ResBlock(width, dilation=3)])
        self.dropout = nn.Dropout(config.dropout)
        self.head = nn.Linear(2 * width, config.dim)
        self.classes = nn.Parameter(torch.randn(classes, config.dim))

    def embed(self, x: Tensor, mask: Tensor) -> Tensor:
        """(B, dim) features of unit length."""
        for down in self.downs:
            mask = cast(Tensor, coarser(mask))
            x = down(x, mask)
        for block in self.blocks:
            x = block(x, mask)
        x, count = widened(keep(self.dropout(x), mask)), mask.sum(-1)
        mean = x.sum(-1) / count
        variance = (keep(x - mean[..., None], mask)).square().sum(-1) / count
        return F.normalize(widened(self.head(torch.cat([mean, (variance + 1e-5).sqrt()], -1))), dim=-1)

    def logits(self, embedding: Tensor) -> Tensor:
        """(B, classes): scaled cosines of features and classes."""
        with full_precision(embedding):
            return self.scale * embedding @ F.normalize(self.classes, dim=-1).t()


class StyleEvaluator(Trainable):
    """Two classifiers of motion without anything in common: what style, and what content (action).

    ``style(raw (B, T, D), frames (B,))`` and ``content(...)`` give logits over the context's styles or actions and
    features (B, dim). Frames beyond a multiple of four are left out; shorter motions than that are an InputError.
    Neither depends on padding or on the rest of the batch. The thesis trains them on the training sets alone; here
    the same: nothing of a held-out combination of style and action.
    """

    def __init__(self, config: StyleEvaluatorConfig, context: Context):
        super().__init__()
        self.config, self.context = config, context
        self.normalizer = Normalizer(context.mean, context.std)
        self.groups = sorted(context.slices.values(), key=lambda part: part.start)
        self.branches = nn.ModuleDict()
        for name, classes in (("style", context.styles), ("content", context.actions)):
            if config.trained and classes:
                self.branches[name] = Classifier(context.dim, len(classes), config)

    def style(self, raw: Tensor, frames: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (B, styles) and features (B, dim)."""
        return self._judge("style", *self._input(raw, frames))

    def content(self, raw: Tensor, frames: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (B, actions) and features (B, dim)."""
        return self._judge("content", *self._input(raw, frames))

    def loss(
        self, batch: LabeledBatch, progress: float, generator: torch.Generator
    ) -> tuple[Tensor, dict[str, Tensor]]:
        """Sum of both cross-entropies over the items whose label is known (-1 is not), with accuracies as logs."""
        x, mask = self._input(batch.motion, batch.frames)  # (B, D, T), (B, 1, T)
        if self.training:
            x = keep(self._disturb(x, generator), mask)
        total, logs = x.new_zeros(()), {}
        for name, labels in (("style", batch.style), ("content", batch.action)):
            known = labels >= 0  # (B,)
            if name in self.branches and bool(known.any()):
                logits, _ = self._judge(name, x[known], mask[known])  # (K, classes)
                # Held-out losses are compared over the training: smoothing would hide how sure the answers become.
                smoothing = self.config.label_smoothing if self.training else 0.0
                total = total + F.cross_entropy(logits, labels[known], label_smoothing=smoothing)
                logs[name] = (logits.detach().argmax(-1) == labels[known]).float().mean()
        return total, logs

    def _judge(self, name: str, x: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
        if name not in self.branches:
            raise InputError("style_evaluator", name, "was not trained: the corpus has no style labels")
        branch = cast(Classifier, self.branches[name])
        embedding = branch.embed(x, mask)
        return branch.logits(embedding), embedding

    def _input(self, raw: Tensor, frames: Tensor) -> tuple[Tensor, Tensor]:
        """Normalized features (B, D, T), zero beyond whole steps, and the mask (B, 1, T)."""
        frames = frames - frames % UNIT
        if int(frames.min()) < UNIT:
            raise InputError("frames", int(frames.min()), f"a motion needs at least {UNIT} frames to be judged")
        longest = int(frames.max())
        mask = length_mask(frames, longest)[:, None].to(raw.dtype)
        return keep(self.normalizer(raw[:, :longest]).transpose(1, 2), mask), mask

    def _disturb(self, x: Tensor, generator: torch.Generator) -> Tensor:
        noise = torch.randn(x.shape, generator=generator, device=x.device, dtype=x.dtype)
        shown = torch.rand(len(x), len(self.groups), generator=generator, device=x.device) >= self.config.group_dropout
        gains = torch.cat([shown[:, i, None].expand(-1, g.stop - g.start) for i, g in enumerate(self.groups)], 1)
        return (x + self.config.noise * noise) * gains[..., None]


class StyleJudge:
    """Trained classifiers, for motions of any length and number.

    Args:
        model: the classifiers.
        hash: names their weights.
        device: where to compute.
        batch_size: items per forward pass; items are sorted by length, so padding costs little.
    """

    def __init__(self, model: StyleEvaluator, device: str = "cpu", batch_size: int = 64, hash: str = ""):
        self.model, self.hash = model.to(device).eval(), hash
        self.device, self.batch_size = device, batch_size

    @classmethod
    def open(cls, folder: Path, device: str = "cpu", batch_size: int = 64) -> StyleJudge:
        """The trained classifiers of a folder."""
        return cls(cast(StyleEvaluator, load_model(folder, device)), device, batch_size, model_hash(folder))

    @property
    def trained(self) -> bool:
        """Whether there were style labels to learn from."""
        return "style" in self.model.branches

    def style(self, features: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Logits (N, styles) and unit features (N, dim) of raw motion features, each (T, D)."""
        return self._judge(self.model.style, features)

    def content(self, features: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Logits (N, actions) and unit features (N, dim) of raw motion features, each (T, D)."""
        return self._judge(self.model.content, features)

    @torch.no_grad()
    def _judge(
        self, judge: Callable[[Tensor, Tensor], tuple[Tensor, Tensor]], features: Sequence[np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        found: list[tuple[np.ndarray, np.ndarray]] = [(np.zeros(0), np.zeros(0))] * len(features)
        for rows in by_length([len(f) for f in features], self.batch_size):
            batch, frames = pad([features[i] for i in rows])
            logits, embedding = judge(batch.to(self.device), frames.to(self.device))
            for row, *answer in zip(rows, logits.cpu().numpy(), embedding.cpu().numpy(), strict=True):
                found[row] = (answer[0], answer[1])
        return np.stack([logits for logits, _ in found]), np.stack([embedding for _, embedding in found])
