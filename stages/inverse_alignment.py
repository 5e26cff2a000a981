"""Trains text2token on through the frozen captioner (TM2T Eq. 7)."""

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
    """corpus, tokenizer, motion2text, text2token -> models/inverse_alignment, reports/inverse_alignment.json"""
    with Stage("inverse_alignment", config, ROOT) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        model, settings = build(stage, corpus.context), stage.training()
        tokens = TokenStore.load(stage.input(f"models/{model.config.tokenizer}"))
        data = Pairs(corpus, "train", tokens, motion=False, **model.reads, **stage.data)
        validation = Pairs(corpus, "val", tokens, all_captions=True, motion=False, **model.reads)

        history = train(stage, model, data, validation, settings, length_sorted=True)
        with stage.publish("models/inverse_alignment") as folder:
            save_model(folder, "inverse_alignment", model, corpus.context)
        stage.report({"training": last_losses(history)})


if __name__ == "__main__":
    main()
