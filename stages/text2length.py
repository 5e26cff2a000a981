"""Trains the distribution of lengths given a text (thesis 4.2.2)."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.batches import Pairs
from motionary.corpus.store import Corpus
from motionary.evaluation.lengths import draw_densities, score_lengths
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.train import build, last_losses, train
from motionary.systems.io import save_model
from motionary.systems.t2m.text2length import Lengths


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus -> models/text2length, reports/text2length.json"""
    with Stage("text2length", config, ROOT, sections=("language",)) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        model, settings = build(stage, corpus.context), stage.training()
        # Whole windows: a dropped unit would be another length.
        data = Pairs(corpus, "train", drop_unit=0.0, motion=False)
        validation = Pairs(corpus, "val", all_captions=True, motion=False)

        history = train(stage, model, data, validation, settings)
        with stage.publish("models/text2length") as folder:
            save_model(folder, "text2length", model, corpus.context)
        lengths = Lengths(model)
        stage.figure("densities", draw_densities(lengths, corpus))
        stage.report({"lengths": score_lengths(lengths, corpus), "training": last_losses(history)})


if __name__ == "__main__":
    main()
