"""Trains the contrastive text and motion extractors that judge every system (TM2T Eq. 8)."""

from _project import ROOT  # isort: skip

import hydra

from motionary.corpus.batches import Pairs
from motionary.corpus.described import Described, EvenSources
from motionary.corpus.store import Corpus
from motionary.language import TextStates
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
        data, held = Pairs(corpus, "train", **stage.data), Pairs(corpus, "val", all_captions=True)
        validation = EvenSources(held)
        if model.reads_states:
            states = TextStates()
            data, validation = Described(data, states), EvenSources(held, Described(held, states, raw=True))

        history = train(stage, model, data, validation, settings)
        with stage.publish("models/evaluator") as folder:
            save_model(folder, "evaluator", model, corpus.context)
        stage.report({"training": last_losses(history), "sources": list(validation.sources)})


if __name__ == "__main__":
    main()
