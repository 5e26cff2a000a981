"""How the systems of TM2T are built on what they need, and opened for use."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from motionary.corpus.context import Context
from motionary.errors import InputError, configure
from motionary.systems.io import Trained

if TYPE_CHECKING:
    from motionary.systems.tm2t.captioner import Captioner
    from motionary.systems.tm2t.inverse_alignment import InverseAlignment
    from motionary.systems.tm2t.motion2text import Motion2Text
    from motionary.systems.tm2t.text2token import Text2Token
    from motionary.systems.tm2t.token_generator import TokenGenerator
    from motionary.systems.tm2t.tokenizer import Tokenizer


def build_tokenizer(settings: Mapping[str, Any], context: Context, trained: Trained) -> Tokenizer:
    """A fresh tokenizer; `settings` are the keys of its config."""
    from motionary.systems.tm2t.tokenizer import Tokenizer, TokenizerConfig

    return Tokenizer(configure(TokenizerConfig, settings, "tokenizer"), context)


def open_codec(trained: Trained, name: str) -> Tokenizer:
    """The trained tokenizer."""
    return trained.load(name)


def build_motion2text(settings: Mapping[str, Any], context: Context, trained: Trained) -> Motion2Text:
    """A fresh captioner for the tokens of `trained`'s tokenizer; `settings` are the remaining keys of its config."""
    from motionary.systems.tm2t.motion2text import Motion2Text, Motion2TextConfig

    config = configure(
        Motion2TextConfig, {"codebook_size": trained.config("tokenizer")["codebook_size"], **settings}, "motion2text"
    )
    most = trained.config("tokenizer").get("num_quantizers", 1)
    if config.token_layers > most:
        raise InputError("motion2text.token_layers", config.token_layers, f"must be at most the tokenizer's, {most}")
    model = Motion2Text(config, context)
    if config.tokens and config.start_from_codebook:
        model.start_from(trained.load("tokenizer").quantizer.codebooks()[: config.token_layers].flatten(0, 1))
    return model


def open_captioner(trained: Trained, name: str) -> Captioner:
    """The captioner with all its members and, where it reads tokens, their tokenizer."""
    from motionary.systems.tm2t.captioner import Captioner
    from motionary.systems.tm2t.motion2text import member_name

    first = trained.load(name)
    others = [trained.load(f"{name}/{member_name(number)}") for number in range(1, first.config.ensemble)]
    return Captioner([first, *others], trained.load(first.config.tokenizer) if first.config.tokens else None)


def build_text2token(settings: Mapping[str, Any], context: Context, trained: Trained) -> Text2Token:
    """A fresh model that writes the tokens of a trained tokenizer; `settings` are the remaining keys of its config."""
    from motionary.systems.tm2t.text2token import Text2Token, Text2TokenConfig

    config = configure(
        Text2TokenConfig, {"codebook_size": trained.config("tokenizer")["codebook_size"], **settings}, "text2token"
    )
    return Text2Token(config, context)


def build_inverse_alignment(settings: Mapping[str, Any], context: Context, trained: Trained) -> InverseAlignment:
    """The trained text2token, to be trained on through the trained motion2text.

    `settings` are the config's own keys; those that text2token fixed may be overridden where they change no weight
    (dropout, teacher forcing, sampling).
    """
    from motionary.systems.tm2t.inverse_alignment import InverseAlignment, InverseAlignmentConfig

    start, reader = trained.load("text2token"), trained.load("motion2text")
    config = configure(InverseAlignmentConfig, {**dataclasses.asdict(start.config), **settings}, "inverse_alignment")
    model = InverseAlignment(config, context)
    model.load_state_dict(start.state_dict())
    if config.alignment or reader.config.tokens:
        model.learn_from(reader)  # the control is only scored by it
    return model


def open_token_generator(trained: Trained, name: str) -> TokenGenerator:
    """A generator that writes tokens, with the tokenizer that it was trained on."""
    from motionary.systems.tm2t.token_generator import TokenGenerator

    model = trained.load(name)
    return TokenGenerator(model, trained.load(model.config.tokenizer))
