"""How many codes of each sequence are learned so far (thesis 4.2.3, "Training Scheme")."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn


class Curriculum(nn.Module):
    """Starts with the first codes of every sequence and appends some whenever the validation's reconstruction rises.

    The thesis trains each stage on sequences of at least its length only, which would leave the longest alone at the
    end; here shorter ones stay, at their own length. The state lies in buffers: a resumed training stands where it was.

    Args:
        start: codes of the first stage.
        add: codes that each later stage appends.
        most: codes of the last stage.
        patience: validations after which a stage ends although the reconstruction still falls.
    """

    codes: Tensor
    previous: Tensor
    validations: Tensor

    def __init__(self, start: int, add: int, most: int, patience: int):
        super().__init__()
        self.start, self.add, self.most, self.patience = min(start, most), add, most, patience
        self.register_buffer("codes", torch.tensor(self.start))
        self.register_buffer("previous", torch.tensor(math.inf))
        self.register_buffer("validations", torch.tensor(0))

    @property
    def length(self) -> int:
        """Codes of the stage."""
        return int(self.codes)

    def observe(self, reconstruction: float) -> None:
        """The rule, after each validation; every stage is compared with itself only."""
        self.validations += 1
        if reconstruction > float(self.previous) or int(self.validations) >= self.patience:
            self._move(self.length + self.add)
        else:
            self.previous.fill_(reconstruction)

    def at_least(self, part: float) -> None:
        """Move on to where the stages would be if they were spread evenly, at `part` (0..1) of their time."""
        due = self.start + int((self.most - self.start) * min(1.0, part))
        if due > self.length:
            self._move(due)

    def _move(self, codes: int) -> None:
        self.codes.fill_(min(codes, self.most))
        self.previous.fill_(math.inf)
        self.validations.zero_()
