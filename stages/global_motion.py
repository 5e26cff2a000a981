"""Trains the predictor of the root's velocities (thesis 5.2.2) on the union of all clips."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.cells import style_split
from motionary.corpus.labeled import Labeled
from motionary.corpus.store import Corpus
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.train import build, last_losses, train
from motionary.systems.io import save_model


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus -> models/global_motion, reports/global_motion.json"""
    with Stage("global_motion", config, ROOT, sections=("styles",)) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        split = style_split(corpus, **stage.values["styles"], seed=stage.seed)
        model, settings = build(stage, corpus.context), stage.training()
        window = stage.data["window"]
        validation = Labeled(corpus, split.validation, window, random=False)
        history = train(stage, model, Labeled(corpus, split.train, window), validation, settings)
        with stage.publish("models/global_motion") as folder:
            save_model(folder, "global_motion", model, corpus.context)
        stage.report({"training": last_losses(history)})


if __name__ == "__main__":
    main()
