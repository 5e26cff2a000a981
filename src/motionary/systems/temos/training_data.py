"""What TEMOS is trained on: windows in its own features and rate, captions as its language model reads them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from motionary.corpus.datasets import Pairs
from motionary.corpus.ragged import Ragged
from motionary.corpus.refeatured import Refeatured, all_from_corpus, caption_texts, statistics
from motionary.corpus.store import Corpus
from motionary.language.frozen import token_ids, token_states
from motionary.systems.temos.temos import Temos, TemosConfig

CHUNK = 2048  # texts whose states are held at once


class TrainingData(NamedTuple):
    """Both splits, and the features of every window of the corpus."""

    train: Refeatured
    validation: Refeatured
    features: Ragged


def training_data(model: Temos, corpus: Corpus, features: Path, texts: Path, device: str = "cpu") -> TrainingData:
    """The data of a fresh model, which takes the training split's statistics from it.

    Args:
        model: whose config says what is read.
        corpus: with captions; a split without any is an InputError.
        features, texts: folders of what is made once and then read as memory maps: every window's features, and the
            states of every caption's tokens by the frozen language model (the token ids where it is trained too).
        device: of the language model.
    """
    config = model.config
    # The first caption is what validation and tests read; training draws (TEMOS 4.1).
    shared = {"motion": False, "drop_unit": 0.0}
    train = Pairs(corpus, "train", most_captions=config.most_captions, **shared)  # type: ignore[arg-type]
    validation = Pairs(corpus, "val", most_captions=1, **shared)  # type: ignore[arg-type]
    own = Ragged.cached(features, lambda: all_from_corpus(corpus, model.codec, config.fps))
    found, caption_row = caption_texts(corpus, [train, validation])
    read = Ragged.cached(texts, lambda: _read(found, config, device))
    mean, std = statistics(train.rows, own)
    model.take_statistics(torch.from_numpy(mean), torch.from_numpy(std))
    return TrainingData(
        Refeatured(train, own, read, caption_row, config.max_frames),
        Refeatured(validation, own, read, caption_row),
        own,
    )


def _read(texts: Sequence[str], config: TemosConfig, device: str) -> Iterator[np.ndarray]:
    """What the language model makes of each text, in order."""
    name = config.language_model or None
    for start in range(0, len(texts), CHUNK):
        part = texts[start : start + CHUNK]
        yield from token_ids(part, name) if config.fine_tune else token_states(part, name, device)
