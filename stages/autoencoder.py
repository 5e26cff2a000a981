"""Trains the snippet codes of T2M (thesis 4.2.1), on which the evaluator's motion branch stands."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.batches import Windows
from motionary.corpus.store import Corpus
from motionary.evaluation.positions import test_positions
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.train import build, last_losses, train
from motionary.systems.io import save_model


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus -> models/autoencoder, reports/autoencoder.json"""
    with Stage("autoencoder", config, ROOT) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        model, settings = build(stage, corpus.context), stage.training()
        data = Windows(corpus, "train", **stage.data)
        validation = Windows(corpus, "val", stage.data["window"])

        history = train(stage, model, data, validation, settings)
        with stage.publish("models/autoencoder") as folder:
            save_model(folder, "autoencoder", model, corpus.context)
        stage.report({"positions": test_positions(corpus, model), "training": last_losses(history)})


if __name__ == "__main__":
    main()
