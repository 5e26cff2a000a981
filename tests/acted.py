"""Two actions made up of joints: one walks ahead, one stays and raises its arms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from motionary.corpus.batch import Batch
from motionary.corpus.context import Context
from motionary.motion import Skeleton

LABELS = ("raise", "walk")


def make_acted(frames: list[int], seed: int = 0) -> Batch:
    """A batch of joints (B, T, 22, 3) whose item i shows action i % 2; zero beyond its frames."""
    rng, skeleton = np.random.default_rng(seed), Skeleton.named("smpl22")
    joints = np.zeros((len(frames), max(frames), 22, 3), np.float32)
    for row, count in enumerate(frames):
        time, walks = np.arange(count)[:, None], row % 2
        body = skeleton.rest - [0, skeleton.rest[:, 1].min(), 0] + rng.normal(size=3) * [0, 0.01, 0]
        joints[row, :count] = body
        joints[row, :count, :, 2] += walks * 0.05 * time
        joints[row, :count, 16:, 1] += (1 - walks) * 0.3 * np.sin(0.2 * time)
    label = torch.arange(len(frames)) % 2
    return Batch(
        clip=torch.arange(len(frames)),
        frames=torch.tensor(frames),
        joints=torch.from_numpy(joints),
        action=label,
        fine=1 - label,
    )


def acted_context(context: Context) -> Context:
    """A context that knows both actions."""
    return replace(context, actions=LABELS)
