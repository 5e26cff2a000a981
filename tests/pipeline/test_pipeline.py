"""DVC, Hydra and MLflow together, on a copy of this project with a folder of ten demo clips and very small models."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

MICRO = """# @package _global_
scale: micro
autoencoder: {width: 8, code_dim: 8, steps: 4, batch_size: 4, validate_every: 2}
tokenizer: {codebook_size: 8, code_dim: 8, width: 8, fine_width: 8, steps: 6, batch_size: 4, validate_every: 2}
"""
LAST = "tokenizer"


class Project:
    """A copy of the project's tracked files as a git repository of its own."""

    def __init__(self, source: Path, root: Path):
        self.root = root
        for name in ("conf", "stages", "src"):
            shutil.copytree(source / name, root / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
        for name in ("dvc.yaml", ".gitignore", ".dvcignore", "pyproject.toml"):
            shutil.copy(source / name, root / name)
        (root / ".dvc").mkdir()
        shutil.copy(source / ".dvc" / "config", root / ".dvc" / "config")
        (root / "data" / "sources").mkdir(parents=True)
        shutil.copy(source / "data" / "sources" / ".gitignore", root / "data" / "sources" / ".gitignore")
        (root / "conf" / "scale" / "micro.yaml").write_text(MICRO)
        self.clips = root.parent / "clips"
        self.write_clips(10)
        self.env = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "OMP_NUM_THREADS": "1"}
        self.env |= {"PYTHONPATH": str(root / "src"), "GIT_AUTHOR_NAME": "t", "GIT_AUTHOR_EMAIL": "t@example.org"}
        self.env |= {"GIT_COMMITTER_NAME": "t", "GIT_COMMITTER_EMAIL": "t@example.org"}
        self.run("git", "init", "-q")
        self.run("git", "add", "-f", "data/sources/.gitignore")
        overrides = ["scale=micro", "data=folder", "data.roots=[../clips]", "data.ratios=[0.6,0.2,0.2]"]
        overrides += ["threads=1", "data.workers=1"]
        self.overrides = overrides
        self.run(sys.executable, "-m", "motionary.pipeline.params", "write", *overrides)
        self.run("git", "add", ".")
        self.run("git", "commit", "-qm", "start")

    def write_clips(self, count: int) -> None:
        from motionary.corpus.demo import demo_clip
        from motionary.formats import write_motion

        self.clips.mkdir()
        lines = []
        for index in range(count):
            motion, facts = demo_clip(index, seed=5)
            write_motion(motion, self.clips / f"{facts['id']}.npz")
            captions = [{"text": text} for text in facts["captions"]]
            lines.append(json.dumps({"motion": f"{facts['id']}.npz", "captions": captions}))
        (self.clips / "clips.jsonl").write_text("\n".join(lines) + "\n")

    def run(self, *command, check: bool = True) -> str:
        done = subprocess.run(command, cwd=self.root, env=self.env, capture_output=True, text=True, timeout=600)
        if check:
            assert done.returncode == 0, f"{command}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
        return done.stdout + done.stderr

    def ran(self, output: str) -> list[str]:
        """The stages that ran, but for `code`, which always does."""
        names = [line.split("'")[1] for line in output.splitlines() if line.startswith("Running stage")]
        return [name for name in names if name != "code"]

    def runs(self, experiment: str):
        from mlflow import MlflowClient

        client = MlflowClient(f"sqlite:///{self.root / 'mlflow.db'}")
        return client, client.search_runs([client.get_experiment_by_name(experiment).experiment_id])


@pytest.fixture(scope="module")
def project(repository, tmp_path_factory):
    project = Project(repository, tmp_path_factory.mktemp("pipeline") / "project")
    project.first = project.ran(project.run("dvc", "repro", LAST))
    return project


def test_everything_ran_once_and_a_second_time_nothing(project):
    assert project.first == [f"source@{project.clips}", "preprocess", "tokenizer"]
    assert project.ran(project.run("dvc", "repro", LAST)) == []
    assert (project.root / "reports" / "tokenizer.json").exists()
    made = [f"reports/short/{stage}.json" for stage in ("preprocess", "tokenizer")]
    head, *rows = project.run("dvc", "metrics", "show", *made).splitlines()
    assert head.split() == ["Path", "items", "loss", "mm"]
    report = json.loads((project.root / "reports" / "tokenizer.json").read_text())
    (row,) = [row.split() for row in rows if "tokenizer" in row]
    assert row[:2] == [made[1], "-"]
    assert float(row[2]) == pytest.approx(report["training"]["best_validation_loss"], rel=1e-3)
    assert float(row[3]) == pytest.approx(report["positions"]["all"]["local_mm"], rel=1e-2)
    plots, *_ = project.run("dvc", "plots", "show", "--json", "--out", str(project.root.parent / "plots")).splitlines()
    assert "reports/figures/tokenizer/curves.csv" in json.loads(plots)["data"]


def test_an_experiment_with_a_wrong_value_runs_nothing(project):
    params = project.root / "params.yaml"
    before = params.read_text()
    said = project.run("dvc", "exp", "run", "-S", "styles.held_out=0", check=False)
    params.write_text(before)
    assert "error: styles.held_out: 0: must lie between 0 and 1\n" in said
    assert "failed to reproduce 'code'" in said
    assert project.ran(said) == []
    assert project.ran(project.run("dvc", "repro", LAST)) == []


def test_large_outputs_share_their_file_with_the_cache(project):
    frames = project.root / "data" / "corpus" / "frames.npy"
    assert frames.is_symlink() or frames.stat().st_nlink > 1


def test_a_stage_run_has_params_curves_figures_and_tags(project):
    client, (run, *_) = project.runs("tokenizer")
    assert run.info.status == "FINISHED"
    assert run.data.params["tokenizer.codebook_size"] == "8"
    assert run.data.tags["dvc.stage"] == "tokenizer"
    assert len(run.data.tags["git.commit"]) == 40
    assert {"hash.params", "hash.inputs", "hash.code"} <= run.data.tags.keys()
    steps = [point.step for point in client.get_metric_history(run.info.run_id, "validation/loss")]
    assert steps == [2, 4, 6]
    names = {file.path for file in client.list_artifacts(run.info.run_id, "figures")}
    assert {"figures/curves.png", "figures/contexts.png"} <= names
    assert run.info.artifact_uri.startswith((project.root / "mlartifacts").as_uri())


def test_a_sweep_has_a_parent_and_leaves_dvc_status_clean(project):
    before = len(project.runs("tokenizer")[1])
    sweep = ["tokenizer.learning_rate=1e-4,3e-4", "hydra/launcher=joblib", *project.overrides]
    sweep = [o for o in sweep if not o.startswith("data")]
    said = project.run("python", "stages/tokenizer.py", "-m", *sweep)
    _, runs = project.runs("tokenizer")
    children = [run for run in runs if "mlflow.parentRunId" in run.data.tags]
    assert len(children) == 2
    assert len(runs) == before + 3
    assert {run.data.params["tokenizer.learning_rate"] for run in children} == {"0.0001", "0.0003"}
    assert len({run.data.tags["mlflow.parentRunId"] for run in children}) == 1
    assert json.loads(project.run("dvc", "status", "--json", "--with-deps", LAST)) == {"code": ["always changed"]}
    assert len(list(project.root.glob("multirun/*/*/*/models/tokenizer/model.safetensors"))) == 2
    table = said[said.index("tokenizer.learning_rate  best validation loss") :].splitlines()
    rows = {rate: (float(loss), folder) for rate, loss, _, folder in map(str.split, table[1:3])}
    assert rows.keys() == {"0.0001", "0.0003"}
    for loss, folder in rows.values():
        training = json.loads((project.root / folder / "reports" / "tokenizer.json").read_text())["training"]
        assert loss == pytest.approx(training["best_validation_loss"], rel=1e-4)
    assert [loss for loss, _ in rows.values()] == sorted(loss for loss, _ in rows.values())
    (parent,) = [run for run in runs if run.info.run_id == children[0].data.tags["mlflow.parentRunId"]]
    assert table[3] == f'curves: make mlflow, experiment tokenizer, the runs below "{parent.info.run_name}"'
    bars = [line for line in said.splitlines() if "item/s" in line]
    assert {line.split(": ")[0] for line in bars} == {"#0 tokenizer", "#1 tokenizer"}
    assert "\r" not in said


def test_only_what_depends_on_a_changed_parameter_runs(project):
    done = project.run("dvc", "exp", "run", LAST, *_set(project.overrides, "tokenizer.steps=2"))
    assert project.ran(done) == ["tokenizer"]


def test_a_queued_experiment_logs_to_the_one_database(project):
    before = {run.info.run_id for run in project.runs("tokenizer")[1]}
    project.run("dvc", "exp", "run", LAST, "--queue", "-n", "queued-one", *_set(project.overrides, "tokenizer.steps=3"))
    project.run("dvc", "exp", "run", "--run-all")
    new = [run for run in project.runs("tokenizer")[1] if run.info.run_id not in before]
    assert [run.data.tags["dvc.exp_name"] for run in new] == ["queued-one"]
    assert new[0].data.params["tokenizer.steps"] == "3"
    assert new[0].info.status == "FINISHED"


def test_a_changed_an_added_and_a_removed_clip_are_noticed(project):
    project.run("dvc", "exp", "run", LAST, *_set(project.overrides))
    listing = (project.clips / "clips.jsonl").read_text()
    first, *rest = listing.splitlines()
    (project.clips / "clips.jsonl").write_text("\n".join(rest) + "\n")
    assert f"source@{project.clips}" in project.run("dvc", "status", "--with-deps", LAST)
    assert project.ran(project.run("dvc", "repro", "preprocess")) == [f"source@{project.clips}", "preprocess"]
    report = json.loads((project.root / "reports" / "preprocess.json").read_text())
    assert report["read"] == 9
    (project.clips / "clips.jsonl").write_text(listing)
    moved = project.clips / json.loads(first)["motion"]
    bytes_before = moved.read_bytes()
    moved.write_bytes(bytes_before + b"x")
    assert "modified" in project.run("dvc", "status", "--with-deps", LAST)
    moved.write_bytes(bytes_before)


def test_a_stage_ends_well_without_its_tracking_server_and_its_rows_arrive_later(project):
    import socket

    before, options = len(project.runs("tokenizer")[1]), [o for o in project.overrides if not o.startswith("data")]
    with socket.socket() as refusing:
        refusing.bind(("127.0.0.1", 0))
        uri = f"http://127.0.0.1:{refusing.getsockname()[1]}"
        stage = ["python", "stages/tokenizer.py", "tokenizer.commitment_weight=0.3", *options]
        output = project.run("env", f"MLFLOW_TRACKING_URI={uri}", *stage)
    assert output.count(f"warning: MLflow at {uri}: ") == 1
    assert len(project.runs("tokenizer")[1]) == before
    assert "sent what 1 earlier run left" in project.run("python", "-m", "motionary.pipeline.delivery")
    client, runs = project.runs("tokenizer")
    (run,) = [run for run in runs if run.data.params.get("tokenizer.commitment_weight") == "0.3"]
    assert run.info.status == "FINISHED"
    assert [point.step for point in client.get_metric_history(run.info.run_id, "validation/loss")] == [2, 4, 6]
    assert {file.path for file in client.list_artifacts(run.info.run_id, "figures")} >= {"figures/curves.png"}


def test_a_killed_stage_continues_to_the_weights_of_an_unbroken_one(project):
    long = _set(project.overrides, "autoencoder.steps=200", "autoencoder.validate_every=5")
    command = ["dvc", "exp", "run", "autoencoder", *long]
    log = (project.root.parent / "killed.txt").open("w")
    process = subprocess.Popen(
        command, cwd=project.root, env=project.env, stdout=log, stderr=log, start_new_session=True
    )
    deadline = time.monotonic() + 240
    while not list(project.root.glob(".cache/autoencoder/*/autoencoder.safetensors")):
        assert process.poll() is None, "the stage ended before it could be killed"
        assert time.monotonic() < deadline
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert not (project.root / "models" / "autoencoder").exists()
    project.run(*command)
    assert not list(project.root.rglob(".unfinished-*"))
    resumed = (project.root / "models" / "autoencoder" / "model.safetensors").read_bytes()
    _, runs = project.runs("autoencoder")
    assert [run.info.status for run in runs] == ["FINISHED"]  # one run, continued
    shutil.rmtree(project.root / ".cache" / "autoencoder")
    project.run("dvc", "repro", "-f", "-s", "autoencoder")
    assert (project.root / "models" / "autoencoder" / "model.safetensors").read_bytes() == resumed


def test_a_stage_whose_code_changed_is_trained_anew(project):
    """Its finished checkpoint is of other code; edited back, DVC still has the first outcome."""
    weights, report = project.root / "models" / "tokenizer" / "model.safetensors", "reports/tokenizer.json"
    project.run("dvc", "repro", LAST)
    before, code = weights.read_bytes(), json.loads((project.root / report).read_text())["code"]
    module = project.root / "src" / "motionary" / "systems" / "tm2t" / "tokenizer.py"
    text = module.read_text()
    still = "\n_loss = Tokenizer.loss\nTokenizer.loss = lambda *given: (0 * _loss(*given)[0], {})\n"
    module.write_text(text + still)
    assert project.ran(project.run("dvc", "repro", LAST)) == ["tokenizer"]
    assert weights.read_bytes() != before
    assert json.loads((project.root / report).read_text())["code"] != code
    module.write_text(text)
    assert project.ran(project.run("dvc", "repro", LAST)) == []
    assert weights.read_bytes() == before


def test_checkpoints_of_other_runs_stay_only_while_they_are_unfinished(project):
    checkpoints = project.root / ".cache" / LAST
    for other, finished in (("killed", False), ("done", True)):
        (checkpoints / other).mkdir()
        (checkpoints / other / f"{LAST}.safetensors").write_bytes(b"weights")
        if finished:
            (checkpoints / other / "finished").touch()
    project.run("dvc", "repro", "-f", "-s", LAST)
    left = {folder.name: (folder / "finished").exists() for folder in checkpoints.iterdir()}
    assert left.pop("killed") is False
    assert list(left.values()) == [True]  # its own


def _set(overrides: list[str], *more: str) -> list[str]:
    return [part for override in (*overrides, *more) for part in ("-S", override)]
