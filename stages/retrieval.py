"""Embeds every window with the evaluator: the dictionary's search and the baselines that copy."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.store import Corpus
from motionary.evaluation.copies import copy_statistics
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.train import trained_inputs
from motionary.systems.judges.corpus_search import Index, meanings_of
from motionary.systems.judges.judge import Judge


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data/corpus, models/<evaluator> -> models/retrieval, reports/retrieval.json"""
    with Stage("retrieval", config, ROOT) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        name = stage.section["evaluator"]
        judge = Judge(trained_inputs(stage).path("evaluator"), batch_size=stage.section["batch_size"])
        motions = judge.motions([corpus.features(i) for i in range(len(corpus))], progress="embed")
        with stage.publish("models/retrieval") as folder:
            Index(motions, judge.hash, name).save(folder)
            meanings_of(corpus).save(folder)
        copies = copy_statistics(corpus)
        stage.report({"windows": len(corpus), "judge": judge.hash, "copies": copies})


if __name__ == "__main__":
    main()
