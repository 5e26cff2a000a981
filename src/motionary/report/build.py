"""The report of a project folder: what its pipeline left in reports/, data/corpus and models/, whatever is there."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from motionary.corpus.store import Corpus
from motionary.report.document import render
from motionary.report.players import make_examples
from motionary.report.results import Results
from motionary.report.style_players import make_styled
from motionary.report.tables import summary
from motionary.whole import check_output


def build_report(
    root: Path, examples: int = 6, seed: int = 0, device: str = "cpu", facts: Mapping[str, str] | None = None
) -> tuple[str, dict[str, dict[str, float]]]:
    """The page, and the numbers of its main tables by system.

    Args:
        root: the project.
        examples: captions to show as players.
        seed: of the motions generated for them.
        device: where the systems run.
        facts: what the run was, by name, beside what the corpus says of itself.
    """
    results = Results.read(root / "reports")
    folder = root / "data" / "corpus"
    if not folder.is_dir():
        return render(results, results.stages.get("preprocess"), facts=facts), summary(results)
    corpus = Corpus.open(check_output(root, "data/corpus"))
    shown, problems = make_examples(corpus, root / "models", list(results.systems), examples, seed, device)
    styled = make_styled(corpus, root / "models", seed, device)
    told = {"corpus": _corpus(corpus.report), **(facts or {})}
    return render(results, corpus.report, shown, problems, styled, told), summary(results)


def _corpus(report: Mapping[str, Any]) -> str:
    """Name and size of a corpus."""
    counts = [f"{report[key]:,} {what}" for key, what in (("kept", "clips"), ("captions", "captions")) if key in report]
    return ", ".join([str(report.get("name", "unnamed")), *counts])
