"""What every trained network offers to the training loop, with defaults for all but the loss."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor, nn

from motionary.corpus.batch import Batch

Loss = tuple[Tensor, dict[str, Tensor]]  # a scalar, and detached values to log


class Trainable(nn.Module, ABC):
    """A network that says what it is trained to do; it knows nothing of steps, devices and checkpoints.

    A network names in `loss` and `validate` what it reads of a batch by a protocol of :mod:`motionary.corpus.batch`.
    """

    @abstractmethod
    def loss(self, batch: Batch, progress: float, generator: torch.Generator) -> Loss:
        """The scalar that training minimizes, and values to log.

        Args:
            batch: on the network's device.
            progress: from 0 to 1 over the training.
            generator: of everything that the loss draws, apart from dropout.
        """
        ...

    @torch.no_grad()
    def validate(self, batch: Batch) -> dict[str, Tensor]:
        """Values of held-out items; "loss" is what early stopping watches. By default those of :meth:`loss` at the end
        of the training, with the same draws every time, so that validations can be compared."""
        generator = torch.Generator(batch.clip.device).manual_seed(0)
        loss, values = self.loss(batch, 1.0, generator)
        return {"loss": loss, **values}

    def parameter_groups(self, learning_rate: float) -> list[dict[str, Any]]:
        """The optimizer's groups, each with its "params" and its own "lr"; by default one at the full rate."""
        return [{"params": list(self.parameters()), "lr": learning_rate}]

    def after_step(self, step: int, progress: float, generator: torch.Generator) -> None:
        """Called after every optimizer step; by default nothing happens."""

    def after_validation(self, values: Mapping[str, float]) -> None:
        """Called with the means of :meth:`validate`; by default nothing happens."""
