"""Trains latent stylization with style labels and without (thesis 5.2.2)."""

from _project import ROOT  # isort: skip

import hydra

from motionary.corpus.cells import style_split
from motionary.corpus.store import Corpus
from motionary.corpus.triples import Triples
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.train import build, last_losses, train_each
from motionary.systems.io import save_model
from motionary.systems.stylization.stylizer import trainable


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus, models/latents -> models/stylization, reports/stylization.json"""
    with Stage("stylization", config, ROOT, sections=("styles",)) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        split = style_split(corpus, **stage.values["styles"], seed=stage.seed)
        values, settings = stage.model(), stage.training()
        # The thesis drops the label and nothing else: both settings see the same clips.
        labeled = len(split.labeled) > 0
        data = Triples(corpus, split.labeled if labeled else split.train, **stage.data)
        held = split.labeled_validation if labeled else split.validation
        validation = Triples(corpus, held, stage.data["window"])
        own = {"window": stage.data["window"]}
        settled = trainable(values["settings"], corpus.context)
        models = {setting: build(stage, corpus.context, setting=setting, **own) for setting in settled}

        histories = train_each(stage, models, data, validation, settings)
        with stage.publish("models/stylization") as folder:
            for setting, model in models.items():
                save_model(folder / setting, "stylization", model, corpus.context)
        stage.report({setting: last_losses(history) for setting, history in histories.items()})


if __name__ == "__main__":
    main()
