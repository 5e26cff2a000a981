"""Motions of many lengths as padded batches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from tqdm import tqdm


def pad(features: Sequence[np.ndarray]) -> tuple[torch.Tensor, torch.Tensor]:
    """Raw features (T_i, D) as one zero-padded batch (B, T, D) and its frame counts (B,)."""
    frames = torch.tensor([len(f) for f in features])
    batch = np.zeros((len(features), int(frames.max()), features[0].shape[1]), np.float32)
    for place, f in enumerate(features):
        batch[place, : len(f)] = f  # in numpy: torch warns about the corpus's read-only map
    return torch.from_numpy(batch), frames


def by_length(lengths: Sequence[int], batch_size: int, progress: str | None = None):
    """Positions in batches of similar length, shortest first."""
    order = np.argsort(lengths, kind="stable")
    starts = range(0, len(order), batch_size)
    for start in tqdm(starts, desc=progress, disable=progress is None, unit="batch"):
        yield order[start : start + batch_size]
