"""Trains the VQ motion tokenizer (TM2T 3.1) and writes the tokens of every window."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.batches import TokenStore, Windows
from motionary.corpus.store import Corpus
from motionary.evaluation.codebooks import code_usage, draw_contexts
from motionary.evaluation.positions import test_positions
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.train import build, last_losses, train
from motionary.systems.codec import BatchedCodec
from motionary.systems.io import save_model


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus -> models/tokenizer (weights, tokens of every window), reports/tokenizer.json"""
    with Stage("tokenizer", config, ROOT) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        model, settings = build(stage, corpus.context), stage.training()
        data = Windows(corpus, "train", **stage.data)
        validation = Windows(corpus, "val", stage.data["window"])

        history = train(stage, model, data, validation, settings)
        codes = BatchedCodec(model).encode([corpus.features(i) for i in range(len(corpus))], progress="tokens")
        with stage.publish("models/tokenizer") as folder:
            save_model(folder, "tokenizer", model, corpus.context)
            TokenStore.collect(codes).save(folder)
        stage.figure("contexts", draw_contexts(model, codes))
        report = {"positions": test_positions(corpus, model), "codes": code_usage(codes, model.config.codebook_size)}
        stage.report({**report, "training": last_losses(history)})


if __name__ == "__main__":
    main()
