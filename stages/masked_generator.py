"""Trains the masked generator of residual motion tokens (MoMask 3.2, 3.3): plan and detail together."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.batches import TokenStore
from motionary.corpus.store import Corpus
from motionary.corpus.uncaptioned import captioned_codes
from motionary.language import TextStates
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.train import build, last_losses, train
from motionary.systems.io import save_model


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus, models/residual_tokenizer -> models/masked_generator, reports/masked_generator.json"""
    with Stage("masked_generator", config, ROOT, sections=("language",)) as stage:
        corpus, states = Corpus.open(stage.input("data/corpus")), TextStates()
        model, settings = build(stage, corpus.context), stage.training()
        tokens = TokenStore.load(stage.input("models/residual_tokenizer"))
        if model.bank is not None:
            model.bank.take(corpus, tokens, states)
        data, held = captioned_codes(corpus, tokens, states, **stage.data)

        history = train(stage, model, data, held, settings, length_sorted=True)
        with stage.publish("models/masked_generator") as folder:
            save_model(folder, "masked_generator", model, corpus.context)
        stage.report({"training": last_losses(history)})


if __name__ == "__main__":
    main()
