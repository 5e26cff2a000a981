"""The report of a whole small pipeline: evaluated, gathered and drawn by the stage itself."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
from tiny import add_stylizers

from motionary.corpus.store import Corpus
from motionary.evaluation.scores import Protocol
from motionary.evaluation.system import score_system
from motionary.report.build import build_report
from motionary.report.players import make_examples
from motionary.report.style_players import make_styled
from motionary.systems.judges.corpus_search import Index
from motionary.systems.judges.judge import Judge
from motionary.systems.registry import known

SYSTEMS = ("inverse_alignment", "motion2text", "retrieval", "tokenizer")
PROTOCOL = Protocol(
    repetitions=2, multimodality_texts=2, multimodality_samples=4, multimodality_pairs=2, prompt_samples=1,
    bert_score=False,
)  # fmt: skip
CONSENSUS = "motion2text by consensus of 40 draws"
PLANTED = {f"{name}, feet planted" for name in ("inverse_alignment", "retrieval")}
# Only one takes a length, one draws.
ROWS = {"real", *SYSTEMS, "inverse_alignment with real lengths", CONSENSUS, *PLANTED}


def test_examples_show_what_each_system_offers(pipeline):
    corpus = Corpus.open(pipeline / "data/corpus")
    systems = ["inverse_alignment", "motion2text", "retrieval", "tokenizer", "nonsense"]
    examples, problems = make_examples(corpus, pipeline / "models", systems, 3)
    assert len(examples) == 3
    for example in examples:
        assert list(example.labels) == ["real", "inverse_alignment", "retrieval"]
        assert set(example.captions) == {"motion2text", "retrieval"}
        assert len(example.motions) == 3
        assert example.caption in set(corpus.captions.text)
    assert len({example.caption for example in examples}) == 3
    assert problems == [f"nonsense: system: nonsense: must be one of {', '.join(known())}"]
    again, _ = make_examples(corpus, pipeline / "models", systems[:1], 3)
    for a, b in zip(examples, again, strict=True):
        assert np.array_equal(a.motions[1].positions, b.motions[1].positions)


@pytest.fixture(scope="module")
def project(pipeline, repository, tmp_path_factory):
    """A copy of the project with a pipeline that ran up to the evaluation."""
    root = tmp_path_factory.mktemp("project")
    for name in ("stages", "conf"):
        shutil.copytree(repository / name, root / name)
    for name in ("data", "models"):
        shutil.copytree(pipeline / name, root / name)
    (root / "src").symlink_to(repository / "src")
    corpus = Corpus.open(root / "data/corpus")
    (root / "reports/evaluation").mkdir(parents=True)
    for name in SYSTEMS:
        report = score_system(name, root / "models", corpus, PROTOCOL, device="cpu")
        (root / "reports/evaluation" / f"{name}.json").write_text(json.dumps(report))
    return root


def check_page(page: str) -> None:
    for system in SYSTEMS:
        assert f"<td>{system}</td>" in page or f"real, through {system}" in page
    assert page.index("<canvas") < page.index("<table")
    assert "<b>corpus</b> demo, 24 clips" in page
    assert page.count("<canvas") == 2 * 3  # real, inverse_alignment and retrieval
    assert "http://" not in page
    assert "https://" not in page


def test_evaluated_systems_become_a_page_with_players(project):
    page, numbers = build_report(project, examples=2, facts={"scale": "tiny"})
    check_page(page)
    assert "<b>scale</b> tiny" in page
    assert set(numbers) == ROWS
    assert numbers[CONSENSUS].keys() == numbers["motion2text"].keys()
    for metric in ("r1", "r3", "fid", "mm_dist", "diversity", "multimodality", "foot_skating"):
        assert isinstance(numbers["inverse_alignment"][metric], float)


def test_a_generator_that_is_a_codec_too_keeps_the_physics_of_both(project):
    corpus = Corpus.open(project / "data/corpus")
    report = score_system("text2motion", project / "models", corpus, PROTOCOL, device="cpu")
    assert report["physics"].keys() == {"generated", "reconstructed", "real"}
    assert report["physics"]["generated"] != report["physics"]["reconstructed"]


def test_each_judge_judges_wherever_the_search_lives(project, tmp_path):
    shutil.copytree(project / "data", tmp_path / "data")
    shutil.copytree(project / "models", tmp_path / "models")
    corpus, folder = Corpus.open(tmp_path / "data/corpus"), tmp_path / "models"
    plain = score_system("retrieval", folder, corpus, PROTOCOL, device="cpu")
    judge = Judge(folder / "joint_evaluator")
    motions = judge.motions([corpus.features(i) for i in range(len(corpus))])
    Index(motions, judge.hash, "joint_evaluator").save(folder / "retrieval")
    moved = score_system("retrieval", folder, corpus, PROTOCOL, device="cpu")
    assert plain["judges"] == moved["judges"]
    assert len(set(moved["judges"].values())) == 2
    assert plain["real"] == moved["real"]
    # A copy of a training motion is near one in the space that it was sought in.
    assert moved["nearest_training"]["generated"]["least"] == pytest.approx(0, abs=0.01)


def test_a_motion_is_shown_in_other_styles(pipeline, tmp_path):
    corpus = Corpus.open(pipeline / "data/corpus")
    assert make_styled(corpus, pipeline / "models") == []
    shutil.copytree(pipeline / "models", tmp_path / "models")
    add_stylizers(pipeline, tmp_path / "models")
    named = make_styled(corpus, tmp_path / "models")
    assert 3 <= len(named) <= 5
    assert {name for name, _ in named[1:]} <= set(corpus.clips.style)
    assert len({motion.frames for _, motion in named[1:]}) == 1
    assert np.abs(named[1][1].positions - named[2][1].positions).max() > 0
    shutil.rmtree(tmp_path / "models/stylization/supervised")
    assert [name for name, _ in make_styled(corpus, tmp_path / "models")[1:]] == [
        f"by chance, {k}" for k in range(1, 5)
    ]


def test_it_works_when_parts_are_missing(project, tmp_path):
    (tmp_path / "data").mkdir()
    assert "dvc repro" in build_report(tmp_path)[0]
    (tmp_path / "data/corpus").symlink_to(project / "data/corpus")
    assert "clips read" in build_report(tmp_path)[0]
    shutil.copytree(project / "reports", tmp_path / "reports")
    page = build_report(tmp_path, examples=2)[0]
    assert "Not shown: inverse_alignment" in page


@pytest.mark.slow
def test_the_stage_writes_where_it_may(project):
    """Outside DVC nothing of the pipeline is touched."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("DVC_", "MLFLOW_"))}
    line = [sys.executable, "stages/report.py", "hydra.run.dir=out", "report.examples=2"]
    done = subprocess.run(line, cwd=project, capture_output=True, text=True, env=environment, timeout=600)
    assert done.returncode == 0, done.stderr
    page = (project / "out/reports/index.html").read_text()
    check_page(page)
    assert "<b>scale</b> tiny" in page
    assert re.search(r"<b>date</b> \d\d \w+ \d{4}", page)
    assert set(json.loads((project / "out/reports/summary.json").read_text())) == ROWS
    assert not (project / "reports/index.html").exists()
