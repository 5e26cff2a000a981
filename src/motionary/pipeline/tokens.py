"""What the stages of tokenizers have in common: train one, and write the tokens of every window beside its weights."""

from __future__ import annotations

from typing import Any

import numpy as np

from motionary.corpus.batches import TokenStore, Windows
from motionary.corpus.store import Corpus
from motionary.pipeline.stage import Stage
from motionary.pipeline.train import build, last_losses, train
from motionary.systems.codec import BatchedCodec
from motionary.systems.io import save_model


def train_tokenizer(stage: Stage) -> tuple[Corpus, Any, list[np.ndarray], dict[str, Any]]:
    """data/corpus -> models/<stage>.

    Returns:
        the corpus, the model, the codes (S, ...) of every window, and the last values of the training.
    """
    corpus = Corpus.open(stage.input("data/corpus"))
    model, settings = build(stage, corpus.context), stage.training()
    data = Windows(corpus, "train", **stage.data)
    validation = Windows(corpus, "val", stage.data["window"])

    history = train(stage, model, data, validation, settings)
    codes = BatchedCodec(model).encode([corpus.features(i) for i in range(len(corpus))], progress="tokens")
    with stage.publish(f"models/{stage.name}") as folder:
        save_model(folder, stage.name, model, corpus.context)
        TokenStore.collect(codes).save(folder)
    return corpus, model, codes, last_losses(history)
