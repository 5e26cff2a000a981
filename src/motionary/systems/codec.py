"""Motions through a codec, many at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from motionary.nn.padding import by_length, pad
from motionary.systems.protocols import MotionCodec


class BatchedCodec:
    """Passes motions of any number and lengths through a codec, in batches of similar length."""

    def __init__(self, model: MotionCodec, device: str = "cpu", batch_size: int = 64):
        self.model, self.device, self.batch_size = model.to(device).eval(), device, batch_size
        self.unit = model.context.unit

    @torch.no_grad()
    def encode(self, features: Sequence[np.ndarray], progress: str | None = None) -> list[np.ndarray]:
        """Codes (T // unit, ...) of each motion's raw features (T, D)."""
        out: list[np.ndarray] = [np.zeros(0)] * len(features)
        for rows in by_length([len(f) for f in features], self.batch_size, progress):
            batch, frames = pad([features[i] for i in rows])
            codes = self.model.encode(batch.to(self.device), frames.to(self.device)).cpu().numpy()
            for i, code in zip(rows, codes, strict=True):
                out[i] = code[: len(features[i]) // self.unit]
        return out

    @torch.no_grad()
    def reconstruct(self, features: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Decoded raw features, each as long as its input floored to whole units."""
        out: list[np.ndarray] = [np.zeros(0)] * len(features)
        for rows in by_length([len(f) for f in features], self.batch_size):
            batch, frames = pad([features[i] for i in rows])
            batch, frames = batch.to(self.device), frames.to(self.device)
            count = frames // self.unit
            decoded = self.model.decode(self.model.encode(batch, frames), count).cpu().numpy()
            for place, i in enumerate(rows):
                out[i] = decoded[place, : int(count[place]) * self.unit]
        return out
