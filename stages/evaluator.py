"""Trains the contrastive text and motion extractors that judge every system (TM2T Eq. 8)."""

from _project import ROOT  # isort: skip
from typing import cast

import hydra

from motionary.corpus.batches import Pairs
from motionary.corpus.store import Corpus
from motionary.language.vectors import word_vectors
from motionary.models.autoencoder import Autoencoder
from motionary.models.evaluator import Evaluator, EvaluatorConfig
from motionary.models.io import load_model, save_model
from motionary.models.layers import load_word_vectors, seeded
from motionary.training.run import last_losses, train
from motionary.training.stage import Stage, run_stage


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus, models/autoencoder -> models/evaluator, reports/evaluator.json"""
    with Stage("evaluator", config, ROOT, sections=("language",)) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        autoencoder = cast(Autoencoder, load_model(stage.input("models/autoencoder")))
        model_config, settings = stage.divide(EvaluatorConfig, Evaluator.upstream(autoencoder))
        with seeded(stage.seed):
            model = Evaluator(model_config, corpus.context).take_snippets(autoencoder)
            load_word_vectors(model, word_vectors(corpus.context.vocabulary, stage.values["language"]["word_vectors"]))
        data = Pairs(corpus, "train", **stage.data)
        validation = Pairs(corpus, "val", all_captions=True)

        history = train(stage, model, data, validation, settings)
        with stage.publish("models/evaluator") as folder:
            save_model(folder, "evaluator", model, corpus.context)
        stage.report({"training": last_losses(history)})


if __name__ == "__main__":
    main()
