"""Trains the VQ motion tokenizer (TM2T 3.1) and writes the tokens of every window."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.batches import TokenStore, Windows
from motionary.corpus.store import Corpus
from motionary.evaluation.positions import Reconstructor, test_positions
from motionary.evaluation.tokens import code_usage, draw_contexts
from motionary.models.io import save_model
from motionary.models.layers import seeded
from motionary.models.tokenizer import Tokenizer, TokenizerConfig
from motionary.training.run import last_losses, train
from motionary.training.stage import Stage, run_stage


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus -> models/tokenizer (weights, tokens of every window), reports/tokenizer.json"""
    with Stage("tokenizer", config, ROOT) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        model_config, settings = stage.divide(TokenizerConfig)
        with seeded(stage.seed):
            model = Tokenizer(model_config, corpus.context)
        data = Windows(corpus, "train", **stage.data)
        validation = Windows(corpus, "val", stage.data["window"])

        history = train(stage, model, data, validation, settings)
        codes = Reconstructor(model).encode([corpus.features(i) for i in range(len(corpus))], progress="tokens")
        with stage.publish("models/tokenizer") as folder:
            save_model(folder, "tokenizer", model, corpus.context)
            TokenStore.collect(codes).save(folder)
        stage.figure("contexts", draw_contexts(model, codes))
        report = {"positions": test_positions(corpus, model), "codes": code_usage(codes, model_config.codes)}
        stage.report({**report, "training": last_losses(history)})


if __name__ == "__main__":
    main()
