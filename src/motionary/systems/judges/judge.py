"""A trained evaluator as a judge: features of motions and texts in one space."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from motionary.language import Sentence, TextStates
from motionary.nn.padding import by_length, pad
from motionary.systems.io import load_model, model_hash


class Judge:
    """Embeds motions and sentences with any trained network that has `embed_motion`, and `embed_states` where it
    `reads_states` of sentences, else `embed_text`.

    Args:
        folder: of the trained evaluator.
        device: where to compute.
        batch_size: items per forward pass; items are sorted by length, so padding costs little.
    """

    def __init__(self, folder: Path, device: str = "cpu", batch_size: int = 64):
        self.model: Any = load_model(folder, device)
        self.states = TextStates(device)
        self.hash = model_hash(folder)
        self.context = self.model.context
        self.device, self.batch_size = device, batch_size

    @torch.no_grad()
    def motions(self, features: Sequence[np.ndarray], progress: str | None = None) -> np.ndarray:
        """(N, E) features of raw motion features, each (T, D)."""
        out: list[tuple[np.ndarray, np.ndarray]] = []
        for rows in by_length([len(f) for f in features], self.batch_size, progress):
            batch, frames = pad([features[i] for i in rows])
            out.append((rows, self.model.embed_motion(batch.to(self.device), frames.to(self.device)).cpu().numpy()))
        return _collect(out)

    @torch.no_grad()
    def sentences(self, sentences: Sequence[Sentence]) -> np.ndarray:
        """(N, E) features of annotated sentences."""
        out = []
        for rows in by_length([len(sentence.words) for sentence in sentences], 4 * self.batch_size):
            some, states = [sentences[i] for i in rows], self.model.reads_states
            arrays = self.states([s.text for s in some]) if states else self.context.vocabulary.encode_batch(some)
            embed = self.model.embed_states if states else self.model.embed_text
            out.append((rows, embed(*(torch.from_numpy(array).to(self.device) for array in arrays)).cpu().numpy()))
        return _collect(out)


def _collect(parts: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    rows = np.concatenate([rows for rows, _ in parts])
    values = np.concatenate([values for _, values in parts])
    out = np.empty_like(values)
    out[rows] = values
    return out
