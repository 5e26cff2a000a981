"""Trains the distribution of lengths given a text (thesis 4.2.2)."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.batches import Pairs
from motionary.corpus.store import Corpus
from motionary.evaluation.lengths import draw_densities, score_lengths
from motionary.language.vectors import word_vectors
from motionary.models.io import save_model
from motionary.models.layers import load_word_vectors, seeded
from motionary.models.text2length import Lengths, Text2Length, Text2LengthConfig
from motionary.training.run import last_losses, train
from motionary.training.stage import Stage, run_stage


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus -> models/text2length, reports/text2length.json"""
    with Stage("text2length", config, ROOT, sections=("language",)) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        model_config, settings = stage.divide(Text2LengthConfig)
        with seeded(stage.seed):
            model = Text2Length(model_config, corpus.context)
            load_word_vectors(model, word_vectors(corpus.context.vocabulary, stage.values["language"]["word_vectors"]))
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
