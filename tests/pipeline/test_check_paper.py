"""`make check-paper`: training stages take a step each, are measured, and one that fails is named."""

from __future__ import annotations

import json
import shutil

import check_paper
import pytest
from check_paper import Outcome, configure, copy_project, main, run_stages, table, training_stages
from very_small import TRAINED

from motionary.study.experiments import read_pipeline, with_values


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A copy of the project with a very small scale."""
    root = copy_project(tmp_path_factory.mktemp("check") / "project")
    scale = json.dumps({"scale": "micro", **TRAINED})
    (root / "conf/scale/micro.yaml").write_text(f"# @package _global_\n{scale}\n")
    return root


@pytest.fixture(scope="module")
def outcomes(project, pipeline):
    """Of a stage that fails, one that needs it, and one that trains."""
    shutil.copytree(pipeline / "data/corpus", project / "data/corpus")
    configure(project, "micro", 24)
    (project / "stages/autoencoder.py").write_text("raise MemoryError('no memory for the weights')\n")
    return run_stages(project, ["autoencoder", "evaluator", "latents"])


def test_a_stage_takes_one_step_and_is_measured(project, outcomes):
    found = outcomes[2]
    assert (found.stage, found.failure) == ("latents", "")
    assert found.seconds > 0.1
    assert 5e7 < found.memory < 5e9
    assert json.loads((project / "reports/latents.json").read_text())["training"]["steps"] == 1


def test_a_stage_that_fails_is_named_and_the_others_go_on(outcomes):
    assert outcomes[0].failure == "MemoryError: no memory for the weights"
    assert outcomes[1].failure == "not run, since it needs autoencoder"
    lines = table("micro", outcomes).text().splitlines()
    assert [line.split()[0] for line in lines[2:]] == ["autoencoder", "evaluator", "latents"]
    assert "no memory for the weights" in lines[2]
    assert lines[4].endswith("ok")


def test_a_failure_is_the_exit_code(monkeypatch, capsys):
    failed = Outcome("evaluator", 1.0, 10**9, "no memory for the weights")
    monkeypatch.setattr(check_paper, "run_stages", lambda root, names: [Outcome(names[0], 2.0, 10**9), failed])
    assert main([]) == 1
    printed = capsys.readouterr()
    assert "no memory for the weights" in printed.out
    assert printed.err == "error: evaluator: failed at scale=paper\n"


def test_every_stage_that_trains_is_checked(repository, project):
    params = configure(project, "paper", 40)
    stages = with_values(read_pipeline(project), params)["stages"]
    found = training_stages(params, stages)
    files = (repository / "stages").glob("*.py")
    assert set(found) == {file.stem for file in files if file.read_text().startswith('"""Trains ')}
    assert {params[name]["epochs"] for name in found} == {0}
    assert set(found) == set(TRAINED)  # whoever runs the whole pipeline in seconds leaves none at its full length


def test_an_unknown_scale_is_one_line(capsys):
    assert main(["--scale", "huge"]) == 2
    assert "--scale: huge: must be one of paper, paper_kit, " in capsys.readouterr().err
