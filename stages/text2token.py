"""Trains the generator of motion tokens from text (TM2T 3.3)."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.batches import Pairs, TokenStore
from motionary.corpus.store import Corpus
from motionary.language.vectors import word_vectors
from motionary.models.io import save_model
from motionary.models.layers import load_word_vectors, seeded
from motionary.models.text2token import build
from motionary.training.run import last_losses, train
from motionary.training.stage import Stage, run_stage


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus, models/tokenizer -> models/text2token, reports/text2token.json"""
    with Stage("text2token", config, ROOT, sections=("language",)) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        tokenizer = stage.input("models/tokenizer")
        tokens = TokenStore.load(tokenizer)
        settings = stage.training()
        with seeded(stage.seed):
            model = build(stage.model(), corpus.context, tokenizer.parent)
            load_word_vectors(model, word_vectors(corpus.context.vocabulary, stage.values["language"]["word_vectors"]))
        data = Pairs(corpus, "train", tokens, motion=False, **stage.data)
        validation = Pairs(corpus, "val", tokens, all_captions=True, motion=False)

        history = train(stage, model, data, validation, settings, length_sorted=True)
        with stage.publish("models/text2token") as folder:
            save_model(folder, "text2token", model, corpus.context)
        stage.report({"training": last_losses(history)})


if __name__ == "__main__":
    main()
