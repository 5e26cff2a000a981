"""Trains the captioner, motion tokens to words (TM2T 3.2)."""

from _project import ROOT  # isort: skip
from typing import cast

import hydra

from motionary.corpus.batches import Pairs, TokenStore
from motionary.corpus.store import Corpus
from motionary.evaluation.tokens import shifted_tokens
from motionary.models.io import load_model, save_model
from motionary.models.motion2text import build_members, member_seeds
from motionary.models.tokenizer import Tokenizer
from motionary.training.run import last_losses, train_each
from motionary.training.stage import Stage, run_stage


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus, models/tokenizer -> models/motion2text, reports/motion2text.json"""
    with Stage("motion2text", config, ROOT) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        tokenizer = stage.input("models/tokenizer")
        tokens = TokenStore.load(tokenizer)
        settings = stage.training()
        seeds = member_seeds(stage.seed, stage.section["members"])
        members = build_members(stage.model(), corpus.context, tokenizer.parent, seeds)
        raw, shifts = not stage.section["tokens"], stage.section["shifts"]
        stores = None if raw else shifted_tokens(corpus, tokens, cast(Tokenizer, load_model(tokenizer)), shifts)
        data = Pairs(corpus, "train", stores, motion=raw, shifts=shifts, **stage.data)
        validation = Pairs(corpus, "val", tokens, all_captions=True, motion=raw)

        by_name = dict(zip(members, seeds, strict=True))
        histories = train_each(stage, members, data, validation, settings, length_sorted=True, seeds=by_name)
        with stage.publish("models/motion2text") as folder:
            for name, model in members.items():
                save_model(folder / name, "motion2text", model, corpus.context)
        stage.report({name or "training": last_losses(history) for name, history in histories.items()})


if __name__ == "__main__":
    main()
