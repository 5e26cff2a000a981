"""Made-up inputs of given shapes: a context, batches of random features, words and tokens, and one motion."""

from __future__ import annotations

import numpy as np
import torch

from motionary.bench.shapes import Shapes
from motionary.corpus.batch import Batch
from motionary.corpus.context import Context
from motionary.corpus.demo import demo_clip
from motionary.features import UNIT, HumanML3D
from motionary.language import END, START, UNKNOWN, Sentence, Vocabulary
from motionary.motion import Motion, Skeleton

SKELETON = Skeleton.named("smpl22")
FEATURES = HumanML3D(SKELETON).dim
FPS = 20.0


def make_context(shapes: Shapes, max_frames: int = 196) -> Context:
    """A context of 22 joints whose vocabulary has `shapes.vocabulary` words, and whose windows `max_frames` frames."""
    words = tuple(f"word{i}" for i in range(shapes.vocabulary - UNKNOWN - 1))
    sentence = Sentence(" ".join(words), words, ("OTHER",) * len(words))
    return Context(
        skeleton=SKELETON,
        fps=FPS,
        codec="humanml3d",
        unit=UNIT,
        mean=np.zeros(FEATURES, np.float32),
        std=np.ones(FEATURES, np.float32),
        vocabulary=Vocabulary.build([sentence]),
        max_frames=max_frames,
    )


def make_batch(
    items: int,
    frames: int = 0,
    words: int = 0,
    tokens: int = 0,
    codes: int = 0,
    vocabulary: int = 0,
    least_words: int = 0,
) -> Batch:
    """Full-length items: features (items, frames, 263), `words` predicted words each, and `tokens` motion codes.

    With `least_words` captions have from that many words to `words`, spread evenly.
    """
    rng = torch.Generator().manual_seed(0)
    batch = Batch(clip=torch.arange(items), text_key=torch.arange(items))
    if frames:
        batch.motion = torch.randn(items, frames, FEATURES, generator=rng)
        batch.frames = torch.full((items,), frames)
    if words:
        batch.words = torch.randint(UNKNOWN + 1, vocabulary, (items, words + 1), generator=rng)
        batch.words[:, 0], batch.words[:, -1] = START, END
        batch.tags = torch.randint(0, 15, batch.words.shape, generator=rng)
        batch.word_count = torch.linspace(least_words or words, words, items).round().long() + 1
    if tokens:
        batch.tokens = torch.randint(0, codes, (items, tokens), generator=rng)
        batch.token_count = torch.full((items,), tokens)
    return batch


def make_sentences(shapes: Shapes, count: int) -> list[Sentence]:
    """Sentences of known words, as long as captions get."""
    rng = np.random.default_rng(0)
    length = max(1, shapes.words - 1)
    rows = rng.integers(shapes.vocabulary - UNKNOWN - 1, size=(count, length))
    chosen = [tuple(f"word{i}" for i in row) for row in rows]
    return [Sentence(" ".join(words), words, ("NOUN",) * length) for words in chosen]


def make_motion(frames: int) -> Motion:
    """A motion of the demo grammar, played forth and back until it lasts `frames` frames."""
    motion, _ = demo_clip(0, seed=0, fps=FPS)
    there_and_back = np.concatenate([np.arange(motion.frames), np.arange(motion.frames - 2, 0, -1)])
    return Motion(motion.positions[np.resize(there_and_back, frames)], FPS, motion.skeleton)
