"""Trains the generator of motion tokens from text (TM2T 3.3)."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.batches import Pairs, TokenStore
from motionary.corpus.store import Corpus
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.train import build, last_losses, train
from motionary.systems.io import save_model


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus, models/tokenizer -> models/text2token, reports/text2token.json"""
    with Stage("text2token", config, ROOT, sections=("language",)) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        model, settings = build(stage, corpus.context), stage.training()
        tokens = TokenStore.load(stage.input(f"models/{model.config.tokenizer}"))
        data = Pairs(corpus, "train", tokens, motion=False, **stage.data)
        validation = Pairs(corpus, "val", tokens, all_captions=True, motion=False)

        history = train(stage, model, data, validation, settings, length_sorted=True)
        with stage.publish("models/text2token") as folder:
            save_model(folder, "text2token", model, corpus.context)
        stage.report({"training": last_losses(history)})


if __name__ == "__main__":
    main()
