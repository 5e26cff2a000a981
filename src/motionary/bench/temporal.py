"""Cases of the thesis's text-to-motion system: lengths, the temporal VAE's step, and motions from it."""

from __future__ import annotations

import torch

from motionary.bench.made import make_batch, make_context, make_sentences
from motionary.bench.shapes import Shapes
from motionary.bench.workload import Work, noise, training_step
from motionary.features import UNIT


def text2length(shapes: Shapes) -> Work:
    """A training step of text2length."""
    from motionary.systems.t2m.text2length import Text2Length, Text2LengthConfig

    config = Text2LengthConfig(word_dim=shapes.word_dim, text_width=shapes.text_width)
    model = Text2Length(config, make_context(shapes))
    # Captions have 12 words on average (thesis 4.3), here from 3 to 20; the model computes no padding.
    batch = make_batch(shapes.batch, words=shapes.words, vocabulary=shapes.vocabulary, least_words=4)
    batch.frames = torch.full((shapes.batch,), UNIT * shapes.tokens)
    return Work(training_step(shapes, model, lambda: model.loss(batch, 0.5, noise())[0], clip=0.5))


def _temporal_model(shapes: Shapes):
    from motionary.systems.t2m.text2motion import Text2Motion, Text2MotionConfig

    config = Text2MotionConfig(
        word_dim=shapes.word_dim, text_width=shapes.text_width, width=shapes.gru_width,
        attention_width=shapes.text_width, latent=shapes.latent, curriculum_start=shapes.snippets,
        snippet_width=shapes.snippet_width, snippet_dim=shapes.snippet_width,
    )  # fmt: skip
    return Text2Motion(config, make_context(shapes, UNIT * shapes.snippets))


def text2motion(shapes: Shapes) -> Work:
    """A training step of the temporal VAE, unrolled over all codes."""
    model = _temporal_model(shapes)
    batch = make_batch(shapes.sequences, UNIT * shapes.snippets, shapes.words, vocabulary=shapes.vocabulary)
    return Work(training_step(shapes, model, lambda: model.loss(batch, 0.5, noise())[0], clip=0.5))


def prompts(shapes: Shapes) -> Work:
    """Sentences to motions of a known length, in one batch."""
    from motionary.systems.t2m.motion_generator import MotionGenerator
    from motionary.systems.t2m.text2length import Lengths, Text2Length, Text2LengthConfig

    model = _temporal_model(shapes)
    config = Text2LengthConfig(word_dim=shapes.word_dim, text_width=shapes.text_width)
    generator = MotionGenerator(model, Lengths(Text2Length(config, model.context)).sample)
    sentences, frames = make_sentences(shapes, shapes.prompts), [UNIT * shapes.tokens] * shapes.prompts
    return Work(lambda: generator.generate(sentences, list(range(shapes.prompts)), frames))
