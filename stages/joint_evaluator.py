"""Trains the second judge, which sees joints alone, on the same training split as the first."""

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
    """data/corpus -> models/joint_evaluator, reports/joint_evaluator.json"""
    with Stage("joint_evaluator", config, ROOT) as stage:
        corpus, states = Corpus.open(stage.input("data/corpus")), TextStates()
        model, settings = build(stage, corpus.context), stage.training()
        pairs = Pairs(corpus, "train", drop_unit=0, motion=False, random=stage.data["every_caption"])
        held = Pairs(corpus, "val", drop_unit=0, motion=False, all_captions=True)
        data = Described(pairs, states, joints=True)
        validation = EvenSources(held, Described(held, states, joints=True, raw=True))

        history = train(stage, model, data, validation, settings, length_sorted=True)
        with stage.publish("models/joint_evaluator") as folder:
            save_model(folder, "joint_evaluator", model, corpus.context)
        stage.report({"training": last_losses(history), "sources": list(validation.sources)})


if __name__ == "__main__":
    main()
