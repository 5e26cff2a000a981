"""Trains the predictor of the root's velocities (thesis 5.2.2) on the union of all clips."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.labeled import Labeled
from motionary.corpus.store import Corpus
from motionary.corpus.styles import style_split
from motionary.models.global_motion import GlobalMotion, GlobalMotionConfig
from motionary.models.io import save_model
from motionary.models.layers import seeded
from motionary.training.run import last_losses, train
from motionary.training.stage import Stage, run_stage


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus -> models/global_motion, reports/global_motion.json"""
    with Stage("global_motion", config, ROOT, sections=("styles",)) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        split = style_split(corpus, **stage.values["styles"], seed=stage.seed)
        model_config, settings = stage.divide(GlobalMotionConfig)
        with seeded(stage.seed):
            model = GlobalMotion(model_config, corpus.context)
        window = stage.data["window"]
        validation = Labeled(corpus, split.validation, window, random=False)
        history = train(stage, model, Labeled(corpus, split.train, window), validation, settings)
        with stage.publish("models/global_motion") as folder:
            save_model(folder, "global_motion", model, corpus.context)
        stage.report({"training": last_losses(history)})


if __name__ == "__main__":
    main()
