"""Trains the masked autoregression over snippet codes (after MAR), which are computed once."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.store import Corpus
from motionary.corpus.uncaptioned import captioned_codes
from motionary.language import TextStates
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.train import build, last_losses, train
from motionary.systems.io import save_model
from motionary.systems.masked.components import snippet_components


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus, models/autoencoder -> models/masked_autoregression, reports/masked_autoregression.json"""
    with Stage("masked_autoregression", config, ROOT, sections=("language",)) as stage:
        corpus, states = Corpus.open(stage.input("data/corpus")), TextStates()
        model, settings = build(stage, corpus.context), stage.training()
        codes, kept = snippet_components(corpus, model)
        data, held = captioned_codes(corpus, codes, states, motion=model.config.decoder_items > 0, **stage.data)

        history = train(stage, model, data, held, settings, length_sorted=True)
        with stage.publish("models/masked_autoregression") as folder:
            save_model(folder, "masked_autoregression", model, corpus.context)
        stage.report({"kept_variance": kept, "training": last_losses(history)})


if __name__ == "__main__":
    main()
