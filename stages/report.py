"""Gathers every report, curve and figure, and some generated motions, into one page."""

from _project import ROOT  # isort: skip
import hydra

from motionary.corpus.store import Corpus
from motionary.formats.files import write_bytes
from motionary.report.document import render
from motionary.report.players import make_examples
from motionary.report.results import Results
from motionary.report.tables import summary
from motionary.training.stage import Stage, run_stage


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """all reports, data/corpus, models -> reports/index.html, reports/summary.json"""
    with Stage("report", config, ROOT) as stage:
        corpus = Corpus.open(stage.input("data/corpus"))
        results = Results.read(ROOT / "reports")
        names, count = list(results.systems), stage.section["examples"]
        examples, problems = make_examples(corpus, ROOT / "models", names, count, stage.seed)
        page = render(results, results.stages.get("preprocess"), examples, problems)
        path = write_bytes(stage.workspace.target / "reports" / "index.html", page)
        stage.tracker.artifact(path)
        stage.report(summary(results), "reports/summary.json")


if __name__ == "__main__":
    main()
