"""Trains the captioner, motion tokens to words (TM2T 3.2)."""

from _project import ROOT  # isort: skip
from dataclasses import replace
from typing import cast

import hydra

from motionary.corpus.batches import Pairs, TokenStore
from motionary.corpus.caption_words import caption_sources, captions_vocabulary
from motionary.corpus.store import Corpus
from motionary.evaluation.codebooks import shifted_tokens
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.train import build, last_losses, train_each
from motionary.systems.io import load_model, save_model
from motionary.systems.protocols import MotionCodec
from motionary.systems.tm2t.motion2text import member_name, member_seeds


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus, models/tokenizer -> models/motion2text, reports/motion2text.json"""
    with Stage("motion2text", config, ROOT) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        settings, seeds = stage.training(), member_seeds(stage.seed, stage.section["ensemble"])
        context = corpus.context
        written = captions_vocabulary(corpus) if stage.section["wording"] == "written" else None
        if written is not None:
            context = replace(context, vocabulary=written)
        first = stage.section["source"]
        sources = () if first == "none" else caption_sources(corpus, first)
        members = {member_name(i): build(stage, context, seed, sources=sources) for i, seed in enumerate(seeds)}
        tokenizer = stage.input(f"models/{members[''].config.tokenizer}")
        tokens = TokenStore.load(tokenizer)
        raw, shifts = not stage.section["tokens"], stage.section["offsets"]
        stores = None if raw else shifted_tokens(corpus, tokens, cast(MotionCodec, load_model(tokenizer)), shifts)
        read = {"motion": raw, "written": written, "sources": sources}
        data = Pairs(corpus, "train", stores, shifts=shifts, **read, **stage.data)
        validation = Pairs(corpus, "val", tokens, all_captions=True, **read)

        by_name = dict(zip(members, seeds, strict=True))
        histories = train_each(stage, members, data, validation, settings, length_sorted=True, seeds=by_name)
        with stage.publish("models/motion2text") as folder:
            for name, model in members.items():
                save_model(folder / name, "motion2text", model, context)
        stage.report({name or "training": last_losses(history) for name, history in histories.items()})


if __name__ == "__main__":
    main()
