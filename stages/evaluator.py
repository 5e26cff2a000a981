"""Trains the contrastive text and motion extractors that judge every system (TM2T Eq. 8)."""

from _project import ROOT  # isort: skip

import hydra

from motionary.corpus.batches import Pairs
from motionary.corpus.store import Corpus
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.train import build, last_losses, train
from motionary.systems.io import save_model


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus, models/autoencoder -> models/evaluator, reports/evaluator.json"""
    with Stage("evaluator", config, ROOT, sections=("language",)) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        model, settings = build(stage, corpus.context), stage.training()
        data = Pairs(corpus, "train", **stage.data)
        validation = Pairs(corpus, "val", all_captions=True)

        history = train(stage, model, data, validation, settings)
        with stage.publish("models/evaluator") as folder:
            save_model(folder, "evaluator", model, corpus.context)
        stage.report({"training": last_losses(history)})


if __name__ == "__main__":
    main()
