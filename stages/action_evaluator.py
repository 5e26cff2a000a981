"""Trains the action classifiers that judge action2motion (thesis 3.3.1), and judges real motions by them."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.acted import Acted, ActionLabels, lengths_told
from motionary.corpus.store import Corpus
from motionary.evaluation.real_actions import judge_real_actions
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.train import build, last_losses, train
from motionary.systems.io import save_model
from motionary.systems.judges.action_evaluator import ActionJudge


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus -> models/action_evaluator, reports/action_evaluator.json"""
    with Stage("action_evaluator", config, ROOT) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        labels, settings, report = ActionLabels.of(corpus), stage.training(), {}
        model = build(stage, corpus.context, coarse=labels.coarse, fine=labels.fine)
        if model.branches:
            data = Acted(corpus, labels, labels.rows(corpus, "train"), **stage.data)
            held = Acted(corpus, labels, labels.held(corpus), stage.data["window"], random=False)
            report["short_windows"] = lengths_told(data, "action_evaluator")
            report["training"] = last_losses(train(stage, model, data, held, settings))
        else:
            stage.figure_path("none").parent.mkdir(exist_ok=True)  # DVC expects the folder
            report["note"] = "the corpus names fewer than two actions: there is nothing to tell apart"
            print(f"action_evaluator: {report['note']}")
        with stage.publish("models/action_evaluator") as folder:
            save_model(folder, "action_evaluator", model, corpus.context)
        stage.report(report | {"real": judge_real_actions(ActionJudge(model), corpus, labels, stage.data["window"])})


if __name__ == "__main__":
    main()
