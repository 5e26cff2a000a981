"""Gathers every report, curve and figure, and some generated motions, into one page."""

from _project import ROOT  # isort: skip
from datetime import date

import hydra

from motionary.files import write_bytes
from motionary.pipeline.stage import Stage, run_stage
from motionary.pipeline.tracking import git_tags
from motionary.report.build import build_report
from motionary.report.results import Results
from motionary.report.verdicts import preferred


@hydra.main(version_base="1.3", config_path="../conf", config_name="config")
@run_stage
def main(config):
    """all reports, data/corpus, models -> reports/index.html, reports/preferred.json, reports/summary.json"""
    with Stage("report", config, ROOT) as stage:
        stage.input("data/corpus")
        page, numbers = build_report(ROOT, stage.section["examples"], stage.seed, facts=_facts(stage.values))
        stage.report(preferred(Results.read(ROOT / "reports")), "reports/preferred.json")
        stage.tracker.artifact(write_bytes(stage.workspace.target / "reports" / "index.html", page))
        stage.report(numbers, "reports/summary.json")


def _facts(values):
    """What a reader must know of the run that the page shows."""
    tags = git_tags(ROOT)
    commit = tags.get("git.commit", "")[:10] + " with changes" * (tags.get("git.dirty") == "true")
    known = {"scale": values.get("scale"), "commit": commit, "date": f"{date.today():%d %B %Y}"}
    return {name: str(value) for name, value in known.items() if value}


if __name__ == "__main__":
    main()
