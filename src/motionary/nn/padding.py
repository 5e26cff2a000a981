"""Motions of many lengths as padded batches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import DTypeLike
from tqdm import tqdm


def pad(features: Sequence[np.ndarray], kind: DTypeLike = np.float32) -> tuple[torch.Tensor, torch.Tensor]:
    """Rows (T_i, ...), such as raw features, as one zero-padded batch (B, T, ...) of a kind, and their counts (B,)."""
    frames = torch.tensor([len(f) for f in features])
    batch = np.zeros((len(features), int(frames.max()), *features[0].shape[1:]), kind)
    for place, f in enumerate(features):
        batch[place, : len(f)] = f  # in numpy: torch warns about the corpus's read-only map
    return torch.from_numpy(batch), frames


def by_length(lengths: Sequence[int], batch_size: int, progress: str | None = None):
    """Yields indices into `lengths`, at most `batch_size` of similar length at a time, shortest first."""
    order = np.argsort(lengths, kind="stable")
    starts = range(0, len(order), batch_size)
    for start in tqdm(starts, desc=progress, disable=progress is None, unit="batch"):
        yield order[start : start + batch_size]
