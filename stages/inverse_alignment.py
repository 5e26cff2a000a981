"""Trains text2token on through the frozen captioner (TM2T Eq. 7)."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.batches import Pairs, TokenStore
from motionary.corpus.store import Corpus
from motionary.models.inverse_alignment import build
from motionary.models.io import save_model
from motionary.models.layers import seeded
from motionary.training.run import last_losses, train
from motionary.training.stage import Stage, run_stage


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """corpus, tokenizer, motion2text, text2token -> models/inverse_alignment, reports/inverse_alignment.json"""
    with Stage("inverse_alignment", config, ROOT) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        tokenizer = stage.input("models/tokenizer")
        stage.input("models/motion2text")
        stage.input("models/text2token")
        tokens = TokenStore.load(tokenizer)
        settings = stage.training()
        with seeded(stage.seed):
            model = build(stage.model(), corpus.context, tokenizer.parent)
        data = Pairs(corpus, "train", tokens, motion=False, **stage.data)
        validation = Pairs(corpus, "val", tokens, all_captions=True, motion=False)

        history = train(stage, model, data, validation, settings, length_sorted=True)
        with stage.publish("models/inverse_alignment") as folder:
            save_model(folder, "inverse_alignment", model, corpus.context)
        stage.report({"training": last_losses(history)})


if __name__ == "__main__":
    main()
