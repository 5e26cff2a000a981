"""Tracking that fails in the middle of a training: the training ends as if it had not, and its rows arrive later."""

import json
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from motionary.pipeline.delivery import main
from motionary.pipeline.journal import JOURNALS, WATCHED, records
from motionary.pipeline.sending import Sender
from motionary.pipeline.tracking import Tracker
from motionary.training.devices import make_fabric
from motionary.training.loop import fit

sys.path.insert(0, str(Path(__file__).parents[1] / "training"))
from toy import Regression, batches, settings

LOCK = """
import sqlite3, sys
database = sqlite3.connect(sys.argv[1], isolation_level=None)
database.execute("BEGIN EXCLUSIVE")
print("locked", flush=True)
sys.stdin.read()
"""
STEPS = list(range(1, 41))


def train(log=None):
    """The weights of the toy model, trained in some tenths of a second."""
    model, config = Regression(), settings(log_every=1)
    fit(model, batches(config), None, config, make_fabric("cpu"), log=log)
    return model.state_dict()


@pytest.fixture
def stage(tmp_path, capfd):
    """Runs a tracked training as the stage of that name: (weights, what was said of MLflow, seconds that it took)."""

    def run(name, meanwhile=lambda folder: None):
        folder = tmp_path / ".cache" / name / "0"
        began, tracker = time.monotonic(), Tracker(tmp_path, name, name, {"steps": 40}, {}, folder)

        def log(step, values):
            tracker.log(step, values)
            if step == 20:
                meanwhile(folder)

        weights = train(log)
        tracker.close()
        said = [line for line in capfd.readouterr().err.splitlines() if "MLflow" in line]
        return weights, said, time.monotonic() - began

    (tmp_path / ".cache").mkdir()
    return run


def same(weights, others):
    return weights.keys() == others.keys() and all(weights[name].equal(others[name]) for name in weights)


def rows(home, stage):
    """(states of the runs of a stage, the steps that their loss is known at) in the project's database."""
    from mlflow import MlflowClient

    client = MlflowClient(f"sqlite:///{home / 'mlflow.db'}")
    runs = client.search_runs([client.get_experiment_by_name(stage).experiment_id])
    assert all(run.data.params == {"steps": "40"} for run in runs)
    points = [point.step for run in runs for point in client.get_metric_history(run.info.run_id, "train/loss")]
    return [run.info.status for run in runs], points


def test_no_fault_of_the_tracking_reaches_the_training(tmp_path, stage, monkeypatch, capfd):
    undisturbed = train()

    def delete(folder):
        deadline = time.monotonic() + 120
        while not list(folder.glob("*.sent")):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        (tmp_path / "mlflow.db").unlink()

    weights, said, _ = stage("deleted", delete)
    assert same(weights, undisturbed)
    assert len(said) == 1
    assert "the database was deleted or replaced" in said[0]
    assert rows(tmp_path, "deleted") == (["FINISHED"], STEPS)  # with those from before it was deleted

    with subprocess.Popen([sys.executable, "-c", LOCK, tmp_path / "mlflow.db"], stdin=-1, stdout=-1) as holder:
        assert holder.stdout.readline() == b"locked\n"
        weights, said, took = stage("locked")
        holder.stdin.close()
    assert same(weights, undisturbed)
    assert len(said) == 1
    assert "database is locked" in said[0]
    assert took < 40

    with socket.socket() as dead, socket.socket() as mute:
        dead.bind(("127.0.0.1", 0))  # never listening: refused
        mute.bind(("127.0.0.1", 0))
        mute.listen(16)  # the system accepts, nobody answers
        for name, server, reason in (("refused", dead, "refused"), ("hung", mute, "timed out")):
            uri = f"http://127.0.0.1:{server.getsockname()[1]}"
            monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
            weights, said, took = stage(name)
            assert same(weights, undisturbed)
            assert len(said) == 1
            assert f"warning: MLflow at {uri}: " in said[0]  # a progress bar may stand before it
            assert reason in said[0]
            assert took < 40
    monkeypatch.delenv("MLFLOW_TRACKING_URI")

    kept = [path.parts[-3] for path in sorted((tmp_path / ".cache").glob(f"*/*/{JOURNALS}"))]
    assert kept == ["hung", "locked", "refused"]
    monkeypatch.chdir(tmp_path)
    assert main([]) == 0
    assert "sent what 3 earlier runs left" in capfd.readouterr().out
    for name in kept:
        assert rows(tmp_path, name) == (["FINISHED"], STEPS)
    assert not list((tmp_path / ".cache").glob("*/*/tracking-*"))


def test_one_process_sends_for_many_stages_and_none_of_them_waits(tmp_path, stage, monkeypatch):
    monkeypatch.setenv(WATCHED, "1")
    assert same(stage("early")[0], train())  # nobody sends yet: its rows wait
    assert list((tmp_path / ".cache").glob(f"early/*/{JOURNALS}"))
    command = [sys.executable, "-m", "motionary.pipeline.delivery", "watch", str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE) as watcher:
        _, said, _ = stage("late")
        assert not said
        assert watcher.stdin is not None
        watcher.stdin.close()
        assert watcher.wait(120) == 0
    for name in ("early", "late"):
        assert rows(tmp_path, name) == (["FINISHED"], STEPS)
    assert not list((tmp_path / ".cache").glob("*/*/tracking-*"))


def test_a_file_that_is_moved_while_it_is_sent_is_looked_for_again(tmp_path, capfd):
    """DVC takes an output into its cache and links it back; one that is gone for good is left out."""
    journal, path = tmp_path / ".cache/stage/0/tracking-1.jsonl", tmp_path / "report.json"
    journal.parent.mkdir(parents=True)
    run = {"kind": "run", "time": 1, "experiment": "stage", "name": "a", "sweep": None, "params": {}, "tags": {}}
    files = [
        {"kind": "artifact", "time": 1, "path": str(tmp_path / name), "folder": None} for name in ("gone", path.name)
    ]
    journal.write_text("".join(json.dumps(record) + "\n" for record in (run, *files)))
    sender = Sender(tmp_path)
    threading.Timer(1.3, path.write_text, ("{}",)).start()  # while the second is looked for
    sender.send(journal)
    (kept,) = (tmp_path / "mlartifacts").rglob("*.json")
    assert kept.read_text() == "{}"
    assert not list((tmp_path / "mlartifacts").rglob("gone"))


def test_a_line_that_a_kill_broke_is_left_out(tmp_path):
    journal = tmp_path / "tracking-1.jsonl"
    journal.write_bytes(b'{"kind": "run"}\n{"kind": "metr\0\0\n{"kind": "end"}\n{"kind": "e')
    assert [record["kind"] for record, _ in records(journal)] == ["run", "end"]
    offset = next(iter(records(journal)))[1]
    assert [record["kind"] for record, _ in records(journal, offset)] == ["end"]
