"""A small context and batches of smooth made-up features."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from motionary.corpus.batches import Batch
from motionary.corpus.context import Context
from motionary.language import Sentence, Vocabulary
from motionary.motion import Skeleton

torch.set_num_threads(1)
WORDS = ["a", "person", "walk", "run", "jump", "wave", "left", "right", "arm", "slowly"]


def make_batch(context: Context, frames: list[int], seed: int = 0) -> Batch:
    """Smooth features of the given lengths with one caption each; words and motion come from one hidden number."""
    rng = np.random.default_rng(seed)
    steps, size = max(frames), len(frames)
    phase = rng.uniform(0, 6, (size, 1, context.dim)) + np.arange(steps)[None, :, None] * rng.uniform(
        0.05, 0.4, (size, 1, context.dim)
    )
    motion = (context.mean + context.std * np.sin(phase)).astype(np.float32)
    count = rng.integers(4, 8, size)
    words = np.zeros((size, 9), np.int64)
    for row, n in enumerate(count):
        words[row, : n + 2] = [1, *rng.integers(4, len(context.vocabulary), n), 2]
        motion[row, frames[row] :] = 0
    tags = np.where(words > 0, rng.integers(0, 15, words.shape), 0)
    return Batch(
        clip=torch.arange(size),
        motion=torch.from_numpy(motion),
        frames=torch.tensor(frames),
        words=torch.from_numpy(words),
        tags=torch.from_numpy(tags),
        word_count=torch.from_numpy(count + 2),
        text_key=torch.arange(size),
    )


def make_context() -> Context:
    """Statistics drawn at random over the 22 joints' features, and a vocabulary of ten words."""
    rng = np.random.default_rng(0)
    sentence = Sentence(" ".join(WORDS), tuple(WORDS), ("OTHER",) * len(WORDS))
    return Context(
        skeleton=Skeleton.named("smpl22"),
        fps=20.0,
        codec="humanml3d",
        unit=4,
        mean=rng.normal(size=263).astype(np.float32),
        std=rng.uniform(0.05, 0.5, 263).astype(np.float32),
        vocabulary=Vocabulary.build([sentence]),
        max_frames=196,
    )


@pytest.fixture(scope="session")
def context() -> Context:
    """The context of `make_context`."""
    return make_context()


@pytest.fixture
def batch(context):
    """Four items of different lengths."""
    return make_batch(context, [32, 24, 16, 28])


@pytest.fixture
def batches():
    """The function that makes batches: (context, frames, seed) -> Batch."""
    return make_batch
