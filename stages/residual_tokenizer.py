"""Trains the residual motion tokenizer (MoMask 3.1) and writes the tokens of every window."""

from _project import ROOT  # isort: skip
import hydra

from motionary.evaluation.codebooks import code_usage, draw_contexts
from motionary.evaluation.positions import test_positions
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.tokens import train_tokenizer


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus -> models/residual_tokenizer (weights, tokens of every window), reports/residual_tokenizer.json"""
    with Stage("residual_tokenizer", config, ROOT) as stage:
        corpus, model, codes, training = train_tokenizer(stage)
        layers = [[tokens[:, layer] for tokens in codes] for layer in range(model.config.num_quantizers)]
        stage.figure("contexts", draw_contexts(model, layers[0]))
        usage = [code_usage(layer, model.config.codebook_size) for layer in layers]
        report = {"positions": test_positions(corpus, model), "codes": usage[0], "layers": usage[1:]}
        stage.report({**report, "training": training})


if __name__ == "__main__":
    main()
