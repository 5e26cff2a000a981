"""How the masked family is built on what it needs, and opened for use."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from motionary.corpus.context import Context
from motionary.errors import configure
from motionary.systems.io import Trained, lengths_of

if TYPE_CHECKING:
    from motionary.systems.masked.masked_autoregression import MaskedAutoregression
    from motionary.systems.masked.masked_generator import MaskedGenerator
    from motionary.systems.masked.motion_filler import MotionFiller
    from motionary.systems.masked.residual_tokenizer import ResidualTokenizer
    from motionary.systems.masked.snippet_generator import SnippetGenerator


def build_residual_tokenizer(settings: Mapping[str, Any], context: Context, trained: Trained) -> ResidualTokenizer:
    """A fresh codec; `settings` are the keys of its config."""
    from motionary.systems.masked.residual_tokenizer import ResidualTokenizer, ResidualTokenizerConfig

    return ResidualTokenizer(configure(ResidualTokenizerConfig, settings, "residual_tokenizer"), context)


def open_codec(trained: Trained, name: str) -> ResidualTokenizer:
    """The trained codec."""
    return trained.load(name)


def build_masked_generator(settings: Mapping[str, Any], context: Context, trained: Trained) -> MaskedGenerator:
    """A fresh generator of the tokens of a trained codec; `settings` are the remaining keys of its config."""
    from motionary.systems.masked.masked_generator import MaskedGenerator, MaskedGeneratorConfig

    tokenizer = trained.load("residual_tokenizer")
    sizes = {key: getattr(tokenizer.config, key) for key in ("codebook_size", "num_quantizers", "code_dim")}
    config = configure(MaskedGeneratorConfig, {**sizes, **settings}, "masked_generator")
    return MaskedGenerator(config, context).take_codebooks(tokenizer.quantizer.codebooks())


def open_motion_filler(trained: Trained, name: str) -> MotionFiller:
    """The generator with its codec, and text2length for durations that are not given."""
    from motionary.systems.masked.motion_filler import MotionFiller

    return MotionFiller(trained.load(name), trained.load("residual_tokenizer"), lengths_of(trained))


def build_masked_autoregression(
    settings: Mapping[str, Any], context: Context, trained: Trained
) -> MaskedAutoregression:
    """A fresh generator of the codes of the trained autoencoder; `settings` are the remaining keys of its config."""
    from motionary.systems.masked.masked_autoregression import MaskedAutoregression, MaskedAutoregressionConfig

    autoencoder = trained.load("autoencoder")
    sizes = autoencoder.config.as_upstream()
    config = configure(MaskedAutoregressionConfig, {**settings, **sizes}, "masked_autoregression")
    return MaskedAutoregression(config, context).take_snippets(autoencoder.encoder, autoencoder.decoder)


def open_components(trained: Trained, name: str) -> MaskedAutoregression:
    """The autoencoder's codes, in the components that the generator tells."""
    return trained.load(name)


def open_snippet_generator(trained: Trained, name: str) -> SnippetGenerator:
    """The generator, with text2length for durations that are not given."""
    from motionary.systems.masked.snippet_generator import SnippetGenerator

    return SnippetGenerator(trained.load(name), lengths_of(trained))
