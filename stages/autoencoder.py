"""Trains the snippet codes of T2M (thesis 4.2.1), on which the evaluator's motion branch stands."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.batches import Windows
from motionary.corpus.store import Corpus
from motionary.evaluation.positions import test_positions
from motionary.models.autoencoder import Autoencoder, AutoencoderConfig
from motionary.models.io import save_model
from motionary.models.layers import seeded
from motionary.training.run import last_losses, train
from motionary.training.stage import Stage, run_stage


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus -> models/autoencoder, reports/autoencoder.json"""
    with Stage("autoencoder", config, ROOT) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        model_config, settings = stage.divide(AutoencoderConfig)
        with seeded(stage.seed):
            model = Autoencoder(model_config, corpus.context)
        data = Windows(corpus, "train", **stage.data)
        validation = Windows(corpus, "val", stage.data["window"])

        history = train(stage, model, data, validation, settings)
        with stage.publish("models/autoencoder") as folder:
            save_model(folder, "autoencoder", model, corpus.context)
        stage.report({"positions": test_positions(corpus, model), "training": last_losses(history)})


if __name__ == "__main__":
    main()
