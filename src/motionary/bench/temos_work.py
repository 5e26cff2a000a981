"""Cases of TEMOS: a training step at the paper's size, and motions of texts."""

from __future__ import annotations

import math

import torch

from motionary.bench.made import make_context
from motionary.bench.shapes import Shapes
from motionary.bench.workload import Work, noise, training_step
from motionary.corpus.batch import Batch
from motionary.features import UNIT
from motionary.language import Sentence
from motionary.language.frozen import state_dim
from motionary.systems.temos.temos import Temos, TemosConfig


def _model(shapes: Shapes) -> Temos:
    config = TemosConfig(
        latent=shapes.temos_width, num_layers=shapes.temos_layers, num_heads=shapes.temos_heads,
        dim_feedforward=shapes.temos_inner, text_dim=state_dim(),
    )  # fmt: skip
    return Temos(config, make_context(shapes))


def temos(shapes: Shapes) -> Work:
    """A training step on stored states of the frozen language model."""
    model, items = _model(shapes), shapes.sequences
    rng = torch.Generator().manual_seed(0)
    batch = Batch(
        clip=torch.arange(items),
        motion=torch.randn(items, shapes.temos_frames, model.codec.dim, generator=rng),
        frames=torch.full((items,), shapes.temos_frames),
        states=torch.randn(items, shapes.temos_tokens, model.config.text_dim, generator=rng),
        state_count=torch.full((items,), shapes.temos_tokens),
    )
    return Work(training_step(shapes, model, lambda: model.loss(batch, 0.5, noise())[0]))


def temos_texts(shapes: Shapes) -> Work:
    """Sentences to motions of a known length, in one batch, by the language model and TEMOS."""
    from motionary.systems.temos.temos_generator import TemosGenerator

    model = _model(shapes)
    generator = TemosGenerator(model, lambda *_: ())
    # As many of the corpus's frames as 100 of TEMOS's own last.
    frames = math.ceil(shapes.temos_frames * model.context.fps / model.config.fps / UNIT) * UNIT
    text = "a person walks forward slowly and then waves with the left hand"
    sentences = [Sentence(f"{text} {k}", tuple(text.split()), ("NOUN",) * 12) for k in range(shapes.prompts)]
    seeds = list(range(shapes.prompts))
    return Work(lambda: generator.generate(sentences, seeds, [frames] * shapes.prompts))
