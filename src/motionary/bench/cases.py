"""What is measured. A case prepares its inputs and returns the work to be timed.

A bound is what the work may cost, in units of a yardstick that is measured in turns with it: GFLOP of matrix products
for networks, GB of copied memory for the rest. Each is 1.1 to 2.4 times what the work was measured at, the more the
shorter and the less even it is.
Seconds of another machine, or ratios to them, would say nothing here.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch

from motionary.bench.actions import action2motion, actions
from motionary.bench.batch_loading import loading
from motionary.bench.long_take import long_bvh
from motionary.bench.made import FPS, make_batch, make_context, make_motion, make_sentences
from motionary.bench.masked_work import MASKED_CASES
from motionary.bench.measure import convolution_flops, cpu_time, least_time
from motionary.bench.shapes import Shapes
from motionary.bench.style import stylization, stylize
from motionary.bench.temos_work import temos, temos_texts
from motionary.bench.temporal import prompts, text2length, text2motion
from motionary.bench.use import first_frame, page, shell
from motionary.bench.workload import COPIES, Bound, Case, Work, clock, noise, training_step
from motionary.features import UNIT

# Modules of the project are imported by the case that needs them: one that is absent is then reported as such, and
# the others still run in as little memory as they need.


def _features(shapes: Shapes) -> Work:
    from motionary.features import HumanML3D

    motion = make_motion(shapes.clip_frames)
    codec = HumanML3D(motion.skeleton)
    return Work(lambda: codec.encode(motion))


def _recover(shapes: Shapes) -> Work:
    from motionary.features.humanml3d import recover_positions

    features = make_batch(1, UNIT * shapes.tokens).motion[0].numpy()
    return Work(lambda: recover_positions(features, 22))


def _tokenizer_model(shapes: Shapes, context: Any):
    from motionary.systems.tm2t.tokenizer import Tokenizer, TokenizerConfig

    config = TokenizerConfig(
        codebook_size=shapes.codes, code_dim=shapes.width, width=shapes.width, fine_width=0, encoder_blocks=1,
        decoder_blocks=3, fine_blocks=1, dilation=1, quantizer="gradient", commitment_weight=1.0, codebook_start=-1,
        position_weight=0,
    )  # fmt: skip
    return Tokenizer(config, context)


def _tokenizer(shapes: Shapes) -> Work:
    model = _tokenizer_model(shapes, make_context(shapes)).train()
    one, batch = make_batch(1, shapes.window), make_batch(shapes.windows, shapes.window)
    flops = shapes.windows * convolution_flops(model, lambda: model.loss(one, 0.5, noise()))
    flops += 2 * shapes.windows * (shapes.window // UNIT) * shapes.codes * shapes.width  # of the nearest codes
    step = training_step(shapes, model, lambda: model.loss(batch, 0.5, noise())[0])
    return Work(step, gflop=flops / 1e9)


def _captioner(shapes: Shapes, context: Any):
    from motionary.systems.tm2t.motion2text import Motion2Text, Motion2TextConfig

    config = Motion2TextConfig(
        codebook_size=shapes.codes, width=shapes.transformer_width, num_layers=shapes.layers,
        dim_feedforward=shapes.feed_forward, num_heads=shapes.heads, dropout=0.1,
    )  # fmt: skip
    return Motion2Text(config, context)


def _motion2text(shapes: Shapes) -> Work:
    model = _captioner(shapes, make_context(shapes))
    batch = make_batch(
        shapes.batch, words=shapes.words, tokens=shapes.source - 2, codes=shapes.codes, vocabulary=shapes.vocabulary
    )
    return Work(training_step(shapes, model, lambda: model.loss(batch, 0.5, noise())[0]))


class _Endless:
    """A decoder that never ends, so that random weights write captions of full length."""

    def __init__(self, decoder: Any, end: int):
        self.decoder, self.end, self.reorder = decoder, end, decoder.reorder

    def step(self, state: Any, tokens: torch.Tensor) -> tuple[torch.Tensor, Any]:
        """The next scores without an end, so that every sentence has its full length."""
        logits, state = self.decoder.step(state, tokens)
        return logits.index_fill(1, torch.tensor([self.end]), -torch.inf), state


def _captions(shapes: Shapes) -> Work:
    from motionary.language import END, START
    from motionary.nn.decoding import beam_search

    model = _captioner(shapes, make_context(shapes)).eval()
    batch = make_batch(shapes.captions, tokens=shapes.tokens, codes=shapes.codes)
    start = torch.full((shapes.captions,), START)

    @torch.no_grad()
    def run() -> None:
        """Encodes the motions and searches for their captions."""
        ids, mask = model.token_source(batch.tokens, batch.token_count)
        state = model.start(model.embed(ids), mask)
        beam_search(_Endless(model, END), state, start, END, 2, 1, shapes.caption_words)

    return Work(run)


def _generator_settings(shapes: Shapes) -> dict[str, Any]:
    return {
        "codebook_size": shapes.codes, "word_dim": shapes.word_dim, "text_width": shapes.text_width,
        "width": shapes.gru_width, "max_tokens": shapes.tokens,
    }  # fmt: skip


def _text2token(shapes: Shapes) -> Work:
    from motionary.systems.tm2t.text2token import Text2Token, Text2TokenConfig

    forced: dict[str, Any] = {"teacher_forcing_start": 1.0, "teacher_forcing_end": 1.0}
    model = Text2Token(Text2TokenConfig(**_generator_settings(shapes), **forced), make_context(shapes))
    batch = make_batch(
        shapes.batch, words=shapes.words, tokens=shapes.unrolled - 1, codes=shapes.codes, vocabulary=shapes.vocabulary
    )
    return Work(training_step(shapes, model, lambda: model.loss(batch, 0.5, noise())[0], clip=0.5))


def _inverse_alignment(shapes: Shapes) -> Work:
    from motionary.systems.tm2t.inverse_alignment import InverseAlignment, InverseAlignmentConfig

    context = make_context(shapes)
    model = InverseAlignment(InverseAlignmentConfig(**_generator_settings(shapes)), context)
    model.learn_from(_captioner(shapes, context))
    batch = make_batch(shapes.batch, words=shapes.words, vocabulary=shapes.vocabulary)
    return Work(training_step(shapes, model, lambda: model.caption_loss(batch, noise())[0], clip=0.5))


def _texts(shapes: Shapes) -> Work:
    from motionary.systems.tm2t.text2token import Text2Token, Text2TokenConfig
    from motionary.systems.tm2t.token_generator import TokenGenerator

    context = make_context(shapes)
    model = Text2Token(Text2TokenConfig(**_generator_settings(shapes)), context)
    generator = TokenGenerator(model, _tokenizer_model(shapes, context).eval())
    sentences = make_sentences(shapes, shapes.texts)
    frames = [UNIT * shapes.tokens] * shapes.texts  # random weights would end at random
    return Work(lambda: generator.generate(sentences, list(range(shapes.texts)), frames))


def _evaluator(shapes: Shapes) -> Work:
    from motionary.systems.judges.evaluator import Evaluator, EvaluatorConfig

    config = EvaluatorConfig(
        text_width=shapes.text_width, motion_width=shapes.motion_width, dim=shapes.embedding, word_dim=shapes.word_dim,
        dropout=0.0, objective="margin", snippet_width=shapes.snippet_width, snippet_dim=shapes.snippet_width,
    )  # fmt: skip
    model = Evaluator(config, make_context(shapes))
    batch = make_batch(shapes.pairs, UNIT * shapes.tokens, shapes.words, vocabulary=shapes.vocabulary)
    return Work(training_step(shapes, model, lambda: model.loss(batch, 0.5, noise())[0], clip=0.5))


def _autoencoder(shapes: Shapes) -> Work:
    from motionary.systems.t2m.autoencoder import Autoencoder, AutoencoderConfig

    config = AutoencoderConfig(width=shapes.snippet_width, code_dim=shapes.snippet_width)
    model = Autoencoder(config, make_context(shapes))
    batch = make_batch(shapes.snippet_windows, shapes.snippet_window)
    return Work(training_step(shapes, model, lambda: model.loss(batch, 0.5, noise())[0]))


def _metrics(shapes: Shapes) -> Work:
    from motionary.metrics import frechet_distance, r_precision

    rng = np.random.default_rng(0)
    text, motion, real = rng.normal(size=(3, shapes.items, shapes.embedding)).astype(np.float32)

    def note(seconds: float) -> str:
        """R-precision, timed apart."""
        return f"R-precision {clock(least_time(lambda: r_precision(text, motion))[0])}, the rest is FID"

    return Work(lambda: (r_precision(text, motion), frechet_distance(motion, real)), note)


def _write(extension: str) -> Callable[[Shapes], Work]:
    def prepare(shapes: Shapes) -> Work:
        """A made motion and a file to write it to, written once."""
        from motionary.formats import write_motion

        folder = tempfile.TemporaryDirectory()  # it goes with the closure
        motion, path = make_motion(round(shapes.seconds * FPS)), Path(folder.name) / f"motion{extension}"
        begun = cpu_time()
        write_motion(motion, path)
        first = cpu_time() - begun
        return Work(lambda: write_motion(motion, path), lambda seconds: f"{clock(first)} for the first of a process")

    return prepare


def _read_bvh(shapes: Shapes) -> Work:
    from motionary.formats import read_motion, write_motion

    folder = tempfile.TemporaryDirectory()
    path = write_motion(make_motion(round(shapes.seconds * FPS)), Path(folder.name) / "motion.bvh")
    return Work(lambda: (folder.name, read_motion(path)))


CASES: tuple[Case, ...] = (
    Case("features", "263 features of a clip of 200 frames", _features, Bound(0.02, COPIES)),
    Case("recover", "positions of 196 frames of features", _recover),
    Case("tokenizer", "tokenizer step, 128 windows x 64 frames, width 1024", _tokenizer, Bound(870)),
    Case("loading", "batches of 128 windows x 64 frames from disk", loading(_tokenizer)),
    Case("motion2text", "motion2text step, batch 64, 55 tokens, 21 words", _motion2text, Bound(680)),
    Case("captions", "captions of 32 motions by beam 2, 30 words", _captions, Bound(260)),
    Case("text2token", "text2token step, teacher-forced, batch 64, 54 tokens", _text2token, Bound(450)),
    Case("inverse_alignment", "inverse-alignment half step (captions), batch 64", _inverse_alignment, Bound(900)),
    Case("texts", "300 texts to motions of 196 frames", _texts, Bound(1650)),
    Case("autoencoder", "autoencoder step, 128 windows x 40 frames", _autoencoder),
    Case("evaluator", "evaluator step, 32 pairs x 196 frames", _evaluator, Bound(270)),
    Case("text2length", "text2length step, batch 64", text2length, Bound(40)),
    Case("text2motion", "temporal VAE step, batch 32, 50 codes", text2motion, Bound(750)),
    Case("prompts", "32 texts by the temporal VAE, 196 frames", prompts, Bound(155)),
    Case("temos", "TEMOS step, 32 x 100 frames, the language model apart", temos, Bound(530)),
    Case("temos_texts", "32 texts by TEMOS, 100 frames, the language model included", temos_texts, Bound(80)),
    *MASKED_CASES,
    Case("stylization", "stylization step, 32 triples x 160 frames", stylization, Bound(350)),
    Case("stylize", "160 frames in another style", stylize(1), Bound(0.25, COPIES)),
    Case("stylize32", "32 x 160 frames in another style", stylize(), Bound(36)),
    Case("action2motion", "action2motion step, 128 x 60 frames", action2motion, Bound(70)),
    Case("actions", "32 actions to motions of 60 frames", actions, Bound(10)),
    Case("metrics", "R-precision and FID of 4000 x 512", _metrics, Bound(1.6, COPIES)),
    Case("mp4", "a motion of 10 s to mp4", _write(".mp4"), Bound(35, COPIES)),
    Case("glb", "a motion of 10 s to glb, with a body", _write(".glb"), Bound(0.3, COPIES)),
    Case("bvh", "a BVH of 10 s read", _read_bvh),
    Case("bvh_long", "a BVH of two minutes read, 73 joints at 120 fps", long_bvh),
    Case("shell", "300 texts to files from the shell, start and load included", shell, Bound(450, COPIES)),
    Case("page", "the page from its start", page, Bound(12, COPIES)),
    Case("first_frame", "from a prompt to a moving figure, scale=small", first_frame, Bound(1.6, COPIES)),
)
