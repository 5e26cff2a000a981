"""Cases of masked generation at `scale=small`: a training step of the plan, and motions of texts."""

from __future__ import annotations

from collections.abc import Callable

import torch

from motionary.bench.made import make_batch, make_context
from motionary.bench.shapes import Shapes
from motionary.bench.workload import Bound, Case, Work, noise, training_step
from motionary.corpus.context import Context
from motionary.features import UNIT
from motionary.language import STATE_DIM, Sentence, TextStates
from motionary.language.frozen import state_dim
from motionary.systems.masked.masked_generator import MaskedGenerator, MaskedGeneratorConfig
from motionary.systems.masked.residual_tokenizer import ResidualTokenizer, ResidualTokenizerConfig


def _model(shapes: Shapes, context: Context, layers: int) -> MaskedGenerator:
    config = MaskedGeneratorConfig(
        shapes.masked_codes, shapes.masked_dim, layers, word_dim=shapes.word_dim, width=shapes.masked_width,
        num_layers=shapes.masked_layers, detail_layers=shapes.masked_layers, num_heads=shapes.masked_heads,
        dim_feedforward=shapes.masked_inner,
    )  # fmt: skip
    return MaskedGenerator(config, context)


def masked_plan(shapes: Shapes) -> Work:
    """A training step on base tokens alone, with stored states of the frozen language model."""
    model, items = _model(shapes, make_context(shapes), 1), shapes.batch
    batch = make_batch(
        items, words=shapes.words, tokens=shapes.masked_tokens, codes=shapes.masked_codes, vocabulary=shapes.vocabulary
    )
    batch.tokens = batch.tokens[..., None]
    batch.states = torch.randn(items, shapes.words, STATE_DIM, generator=noise())
    batch.state_count = torch.full((items,), shapes.words)
    return Work(training_step(shapes, model, lambda: model.loss(batch, 0.5, noise())[0], 1.0))


def masked_texts(count: int = 0) -> Callable[[Shapes], Work]:
    """Sentences to motions of 5 s in one batch, the language model and the decoder included; 0 is `prompts` many."""

    def prepare(shapes: Shapes) -> Work:
        """Models of random weights."""
        from motionary.systems.masked.motion_filler import MotionFiller

        context, number = make_context(shapes), count or shapes.prompts
        codec = ResidualTokenizer(
            ResidualTokenizerConfig(
                codebook_size=shapes.masked_codes,
                num_quantizers=shapes.masked_quantizers,
                code_dim=shapes.masked_dim,
                width=shapes.small_width,
            ),
            context,
        )
        model = _model(shapes, context, shapes.masked_quantizers).take_codebooks(codec.quantizer.codebooks())
        filler = MotionFiller(model, codec, lambda *_: ())
        sentences = [_sentence(k) for k in range(number)]
        frames = [shapes.masked_tokens * UNIT] * number
        state_dim()  # the language model is loaded once for a process

        def run() -> None:
            """The texts as new ones, whose states are not remembered."""
            filler.states = TextStates()
            filler.generate(sentences, list(range(number)), frames)

        return Work(run)

    return prepare


def masked_codes(shapes: Shapes) -> Work:
    """A sentence to a motion of 5 s by masked autoregression, as :func:`masked_texts`."""
    from motionary.systems.masked.masked_autoregression import MaskedAutoregression, MaskedAutoregressionConfig
    from motionary.systems.masked.snippet_generator import SnippetGenerator

    model = MaskedAutoregression(MaskedAutoregressionConfig(word_dim=shapes.word_dim), make_context(shapes))
    generator = SnippetGenerator(model, lambda *_: ())
    state_dim()

    def run() -> None:
        """The text as a new one, whose states are not remembered."""
        generator.states = TextStates()
        generator.generate([_sentence(0)], [0], [shapes.masked_tokens * UNIT])

    return Work(run)


def _sentence(number: int) -> Sentence:
    text = "a person walks forward slowly and then waves with the left hand"
    return Sentence(f"{text} {number}", tuple(text.split()), ("NOUN",) * 12)


MASKED_CASES = (
    Case("masked_plan", "masked plan step, batch 64, 25 tokens, scale=small", masked_plan, Bound(55)),
    Case("masked_text", "a text to 5 s by masked generation, scale=small", masked_texts(1), Bound(14)),
    Case("masked_texts", "32 texts to 5 s by masked generation, scale=small", masked_texts(), Bound(250)),
    Case("masked_codes", "a text to 5 s by masked autoregression, scale=small", masked_codes, Bound(9)),
)
