"""Scores one system by the papers' protocol: whatever it offers, generation, captions or reconstruction."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.store import Corpus
from motionary.errors import configure
from motionary.evaluation.scores import Protocol
from motionary.evaluation.system import judges_of, score_system
from motionary.pipeline.stage import Stage, run_stage


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """the judges, models/retrieval, models/<system> -> reports/evaluation/<system>.json"""
    system = config.evaluation.system
    with Stage("evaluation", config, ROOT, label=system) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        models = stage.serving("retrieval", system, *judges_of(ROOT / "models"))
        settings = {k: v for k, v in stage.section.items() if k not in ("system", "systems")}
        protocol = configure(Protocol, settings, "evaluation")
        stage.report(score_system(system, models, corpus, protocol, stage.seed, config.device))


if __name__ == "__main__":
    main()
