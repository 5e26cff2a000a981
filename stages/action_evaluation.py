"""Scores motions of action labels beside real ones (thesis 3.3.1), and draws what else labels can ask for."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.acted import ActionLabels
from motionary.corpus.store import Corpus
from motionary.errors import configure
from motionary.evaluation.action_figures import draw_uses
from motionary.evaluation.action_scores import ActionProtocol, score_actions
from motionary.formats.render.video import render_strip
from motionary.pipeline.stage import Stage, run_stage
from motionary.systems.action_protocols import ActionClassifier, ActionToMotion
from motionary.systems.io import choose_device, open_system
from motionary.systems.registry import ACT, JUDGE_ACTION


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """models/action2motion, models/action_evaluator -> reports/action_evaluation.json, figures"""
    with Stage("action_evaluation", config, ROOT, sections=("action2motion.window",)) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        labels, protocol = ActionLabels.of(corpus), configure(ActionProtocol, stage.section, "action_evaluation")
        models, device = stage.serving("action2motion", "action_evaluator"), choose_device(config.device)
        stage.figure_path("none").parent.mkdir(exist_ok=True)  # DVC expects the folder
        if not labels.coarse:
            note = "the corpus names no action, so that there is nothing to score"
            print(f"action_evaluation: {note}")
            stage.report({"note": note})
            return
        actor: ActionToMotion = open_system("action2motion", ACT, models, device)
        judge: ActionClassifier = open_system("action_evaluator", JUDGE_ACTION, models, device)
        window = int(config.action2motion.window)
        found = score_actions(actor, judge, corpus, labels, protocol, window, stage.seed)
        for name, (motions, captions) in draw_uses(actor, corpus, labels, window, stage.seed).items():
            strip = stage.figure_path(f"{name}.png")
            render_strip(motions, strip, captions, width=105, height=150)
            stage.tracker.artifact(strip, "figures")
        about = {"evaluator": judge.hash, "corpus": corpus.hash, "repetitions": protocol.repetitions}
        stage.report({**about, "action_generation": found})


if __name__ == "__main__":
    main()
