"""Trains the VQ motion tokenizer (TM2T 3.1) and writes the tokens of every window."""

from _project import ROOT  # isort: skip
import hydra

from motionary.evaluation.codebooks import code_usage, draw_contexts
from motionary.evaluation.positions import test_positions
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.tokens import train_tokenizer


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus -> models/tokenizer (weights, tokens of every window), reports/tokenizer.json"""
    with Stage("tokenizer", config, ROOT) as stage:
        corpus, model, codes, training = train_tokenizer(stage)
        stage.figure("contexts", draw_contexts(model, codes))
        report = {"positions": test_positions(corpus, model), "codes": code_usage(codes, model.config.codebook_size)}
        stage.report({**report, "training": training})


if __name__ == "__main__":
    main()
