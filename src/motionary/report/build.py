"""The report of a project folder: what its pipeline left in reports/, data/corpus and models/, whatever is there."""

from __future__ import annotations

from pathlib import Path

from motionary.corpus.store import Corpus
from motionary.report.document import render
from motionary.report.players import make_examples
from motionary.report.results import Results
from motionary.report.tables import summary


def build_report(
    root: Path, examples: int = 6, seed: int = 0, device: str = "cpu"
) -> tuple[str, dict[str, dict[str, float]]]:
    """The page, and the numbers of its main tables by system.

    Args:
        root: the project.
        examples: captions to show as players.
        seed: of the motions generated for them.
        device: where the systems run.
    """
    results = Results.read(root / "reports")
    folder = root / "data" / "corpus"
    if not folder.is_dir():
        return render(results, results.stages.get("preprocess")), summary(results)
    corpus = Corpus.open(folder)
    shown, problems = make_examples(corpus, root / "models", list(results.systems), examples, seed, device)
    return render(results, corpus.report, shown, problems), summary(results)
