"""How the systems of T2M are built on what they need, and opened for use."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from motionary.corpus.context import Context
from motionary.errors import configure
from motionary.systems.io import Trained, lengths_of
from motionary.systems.protocols import MotionCodec

if TYPE_CHECKING:
    from motionary.systems.t2m.autoencoder import Autoencoder
    from motionary.systems.t2m.motion_generator import MotionGenerator
    from motionary.systems.t2m.text2length import Lengths, Text2Length
    from motionary.systems.t2m.text2motion import Text2Motion


def build_autoencoder(settings: Mapping[str, Any], context: Context, trained: Trained) -> Autoencoder:
    """A fresh autoencoder; `settings` are the keys of its config."""
    from motionary.systems.t2m.autoencoder import Autoencoder, AutoencoderConfig

    return Autoencoder(configure(AutoencoderConfig, settings, "autoencoder"), context)


def build_text2length(settings: Mapping[str, Any], context: Context, trained: Trained) -> Text2Length:
    """A fresh model of lengths; `settings` are the keys of its config."""
    from motionary.systems.t2m.text2length import Text2Length, Text2LengthConfig

    return Text2Length(configure(Text2LengthConfig, settings, "text2length"), context)


def build_text2motion(settings: Mapping[str, Any], context: Context, trained: Trained) -> Text2Motion:
    """A fresh temporal VAE on the codes of the trained autoencoder; `settings` are the remaining keys of its config."""
    from motionary.systems.t2m.text2motion import Text2Motion, Text2MotionConfig

    autoencoder = trained.load("autoencoder")
    config = configure(Text2MotionConfig, {**settings, **autoencoder.config.as_upstream()}, "text2motion")
    return Text2Motion(config, context).take_snippets(autoencoder.encoder, autoencoder.decoder)


def open_codec(trained: Trained, name: str) -> MotionCodec:
    """The trained autoencoder; for text2motion its own copy, whose decoder was trained further."""
    return trained.load(name)


def open_lengths(trained: Trained, name: str) -> Lengths:
    """The sampler of lengths."""
    from motionary.systems.t2m.text2length import Lengths

    return Lengths(trained.load(name))


def open_motion_generator(trained: Trained, name: str) -> MotionGenerator:
    """The generator of motions, with text2length for lengths that are not given."""
    from motionary.systems.t2m.motion_generator import MotionGenerator

    return MotionGenerator(trained.load(name), lengths_of(trained))
