"""The dashboard: columns, the page that it opens on, names of runs, and a project that was moved."""

import json
import subprocess
from pathlib import Path

from motionary.pipeline.dashboard import columns, prepare
from motionary.pipeline.journal import rehome
from motionary.pipeline.tracking import committed_params, run_name


def test_a_moved_project_opens_on_its_last_training_with_its_files(tmp_path):
    from mlflow import MlflowClient

    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    assert prepare(first) == "#/experiments"  # nothing ran yet
    client = MlflowClient(f"sqlite:///{first}/mlflow.db")
    place = (first / "mlartifacts/tokenizer").as_uri()
    experiment = client.create_experiment("tokenizer", artifact_location=place)
    run = client.create_run(experiment).info.run_id
    client.log_metric(run, "validation/loss", 0.5, step=10)
    client.log_metric(run, "training.best_validation_loss", 0.5)
    (tmp_path / "curves.png").write_bytes(b"picture")
    client.log_artifact(run, str(tmp_path / "curves.png"), "figures")
    elsewhere = client.create_experiment("elsewhere", artifact_location="s3://bucket/x")
    first.rename(second)
    page = f"#/experiments/{experiment}/runs?viewStateShareKey=motionary&compareRunsMode=CHART"
    assert prepare(second) == page
    rehome(second)  # a second time changes nothing
    moved = MlflowClient(f"sqlite:///{second}/mlflow.db")
    assert [file.path for file in moved.list_artifacts(run, "figures")] == ["figures/curves.png"]
    assert moved.get_run(run).info.artifact_uri.startswith((second / "mlartifacts").as_uri())
    assert moved.get_experiment(elsewhere).artifact_location == "s3://bucket/x"
    view = json.loads(moved.get_experiment(experiment).tags["mlflow.sharedViewState.motionary"])
    assert view["selectedColumns"] == ["metrics.`training.best_validation_loss`"]


def test_columns_are_what_compares_runs_and_never_a_point_of_a_curve():
    many = [f"positions.part{i}.local_mm" for i in range(20)]
    shown = columns(["train/loss", "validation/loss", "clips", *many, "training.best_validation_loss"])
    assert shown[0] == "metrics.`training.best_validation_loss`"
    assert len(shown) == 8
    assert not any("/" in name for name in shown)


def test_runs_are_called_by_what_differs():
    usual = {"tokenizer": {"codes": 512, "steps": 10, "a": 1, "b": 1, "c": 1, "d": 1}, "seed": 0, "scale": "tiny"}
    same = run_name(["", "demo", "tiny", ""], "tokenizer", usual, usual)
    assert same == "demo tiny"
    other = {"tokenizer": {**usual["tokenizer"], "codes": 256}, "seed": 3}
    assert run_name(["demo", "tiny", "loud-fox"], "tokenizer", other, usual) == "demo tiny loud-fox codes=256 seed=3"
    far = {"tokenizer": dict.fromkeys("abcd", 2) | {"codes": 1, "steps": 2}}
    assert run_name(["demo"], "tokenizer", far, usual).endswith(" and 2 more")


def test_what_is_usual_is_what_was_committed(tmp_path, repository):
    assert committed_params(tmp_path) == {}
    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    (tmp_path / "params.yaml").write_text("seed: 7\nscale: tiny\n")
    git = ["git", "-C", str(tmp_path), "-c", "user.name=x", "-c", "user.email=x@x"]
    subprocess.run([*git, "add", "-A"], check=True)
    subprocess.run([*git, "commit", "-qm", "x"], check=True)
    (tmp_path / "params.yaml").write_text("seed: 8\n")
    assert committed_params(Path(tmp_path)) == {"seed": 7, "scale": "tiny"}
