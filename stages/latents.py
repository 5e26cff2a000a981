"""Trains the motion codes of stylization (thesis 5.2.1) on the union of all clips."""

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
    """data/corpus -> models/latents, reports/latents.json"""
    with Stage("latents", config, ROOT, sections=("styles",)) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        split = style_split(corpus, **stage.values["styles"], seed=stage.seed)
        model, settings = build(stage, corpus.context), stage.training()
        report = {}
        stage.figure_path("none").parent.mkdir(exist_ok=True)  # DVC expects the folder
        if model.config.variant != "none":  # which has nothing to train
            window = stage.data["window"]
            validation = Labeled(corpus, split.validation, window, random=False)
            history = train(stage, model, Labeled(corpus, split.train, window), validation, settings)
            report["training"] = last_losses(history)
        with stage.publish("models/latents") as folder:
            save_model(folder, "latents", model, corpus.context)
        stage.report(report)


if __name__ == "__main__":
    main()
