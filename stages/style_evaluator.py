"""Trains the style and the content classifier that judge stylization (thesis 5.3), and judges real motions by them."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.cells import style_split
from motionary.corpus.labeled import Labeled
from motionary.corpus.store import Corpus
from motionary.evaluation.classifiers import judge_real
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.train import build, last_losses, train
from motionary.systems.io import save_model
from motionary.systems.judges.style_evaluator import StyleJudge


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus -> models/style_evaluator, reports/style_evaluator.json"""
    with Stage("style_evaluator", config, ROOT, sections=("styles",)) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        split = style_split(corpus, **stage.values["styles"], seed=stage.seed)
        labeled = len(split.labeled) > 0
        model, settings = build(stage, corpus.context, trained=labeled), stage.training()
        report = {}
        if labeled:
            data = Labeled(corpus, split.labeled, **stage.data)
            validation = Labeled(corpus, split.labeled_validation, stage.data["window"], random=False)
            report["training"] = last_losses(train(stage, model, data, validation, settings))
        else:
            stage.figure_path("none").parent.mkdir(exist_ok=True)  # DVC expects the folder
            print("style_evaluator: the corpus has no style labels, so that neither style nor content can be judged")
        with stage.publish("models/style_evaluator") as folder:
            save_model(folder, "style_evaluator", model, corpus.context)
        stage.report(report | {"real": judge_real(StyleJudge(model), corpus, split)})


if __name__ == "__main__":
    main()
