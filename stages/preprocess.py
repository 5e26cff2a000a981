"""Turns the data roots, or the demo grammar, into the corpus that everything else reads."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.preprocess import preprocess
from motionary.pipeline.stage import Stage, run_stage


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """data roots -> data/corpus (frames, tables, statistics, vocabulary, splits), reports/preprocess.json"""
    with Stage("preprocess", config, ROOT, sections=("data", "source.roots")) as stage:
        data = {**stage.values["data"], "roots": stage.values["source"]["roots"]}
        report = preprocess(data, stage.workspace.target / "data" / "corpus", root=ROOT)
        stage.report(report)


if __name__ == "__main__":
    main()
