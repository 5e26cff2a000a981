"""What processes killed by SIGKILL leave is removed by the next run, and by `make clean`."""

import os
import shutil
import signal
import subprocess
import sys
import time

import pytest
import yaml

from motionary.pipeline.leftovers import Alone, remove_unfinished, remove_unfinished_checkpoints

WRITER = """
import pathlib, sys
from motionary.files import atomic_file
from motionary.pipeline.workspace import Workspace

root = pathlib.Path.cwd()
with Workspace(root, root, root).publish("models/coder") as folder, atomic_file(root / "reports/coder.json") as report:
    (folder / "half").write_text("h")
    report.write_text("h")
    with atomic_file(root / ".cache" / "coder" / "0" / "coder.safetensors") as checkpoint:
        checkpoint.write_text("h")
        print("writing", flush=True)
        sys.stdin.read()
"""
HOLDER = """
import pathlib, sys
from motionary.pipeline.leftovers import Alone
alone = Alone(pathlib.Path.cwd(), "coder")
print("running", flush=True)
sys.stdin.read()
"""
HALF = ".unfinished-0123abcd-"
STAGES = {
    "coder": {"cmd": "x", "outs": ["models/coder"], "metrics": [{"reports/coder.json": {"cache": False}}]},
    "coder2": {"cmd": "x", "outs": ["models/coder2"]},
    "scores": {"foreach": ["coder"], "do": {"cmd": "x", "metrics": ["reports/scores/${item}.json"]}},
}


@pytest.fixture
def started(tmp_path):
    """Starts a script in the project and waits for its first line; what still runs at the end is killed."""
    processes = []

    def start(script):
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        command = [sys.executable, "-c", script]
        process = subprocess.Popen(command, cwd=tmp_path, env=environment, stdin=-1, stdout=-1, text=True)
        processes.append(process)
        assert process.stdout.readline().endswith("ing\n")
        return process

    (tmp_path / "dvc.yaml").write_text(yaml.safe_dump({"stages": STAGES}))
    yield start
    for process in processes:
        process.kill()
        process.communicate()


def files(root):
    return sorted(path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file())


def test_the_next_run_removes_what_a_killed_one_left_and_nothing_else(tmp_path, started):
    writer = started(WRITER)
    os.kill(writer.pid, signal.SIGKILL)
    writer.wait()
    left = files(tmp_path)
    assert len(left) == 4  # dvc.yaml and three halves
    kept = ["models/.gitignore", f"models/{HALF}coder2", "models/coder/model", f"reports/scores/{HALF}coder.json"]
    for name in kept:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("k")
    remove_unfinished(tmp_path, "coder")
    remove_unfinished_checkpoints(tmp_path / ".cache" / "coder" / "0")
    assert files(tmp_path) == sorted(["dvc.yaml", *kept])
    remove_unfinished(tmp_path, "scores@coder")
    assert f"reports/scores/{HALF}coder.json" not in files(tmp_path)


def test_another_runs_checkpoint_that_is_being_written_stays(tmp_path):
    for name in (f"{run}/{HALF}coder.safetensors" for run in range(3)):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text("h")
    os.utime(tmp_path / f"2/{HALF}coder.safetensors", (time.time() - 9000, time.time() - 9000))
    remove_unfinished_checkpoints(tmp_path / "0")
    assert files(tmp_path) == [f"1/{HALF}coder.safetensors"]


def test_a_stage_waits_for_itself_unless_that_was_killed(tmp_path, started, capfd):
    killed = started(HOLDER)
    killed.kill()
    killed.wait()
    Alone(tmp_path, "coder").release()
    assert capfd.readouterr().err == ""
    first = started(HOLDER)
    second = subprocess.Popen(
        [sys.executable, "-c", HOLDER],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        stdin=-1,
        stdout=-1,
        stderr=-1,
        text=True,
    )
    assert second.stderr.readline().startswith(f"stage coder of an earlier run still runs as process {first.pid}; wait")
    first.communicate("")
    assert second.communicate("", timeout=60)[0] == "running\n"


def test_make_clean_leaves_the_tracking_database_and_no_half(tmp_path, repository):
    shutil.copy(repository / "Makefile", tmp_path)
    halves = [
        f"models/{HALF}coder/half",
        f"reports/{HALF}coder.json",
        f"data/{HALF}corpus/half",
        f".cache/0/{HALF}coder",
    ]
    halves += [
        f"data/sources/root_a/{HALF}inventory.json",
        f"data/sources/{HALF}root_a/half",
        ".cache/running/coder.lock",
    ]
    kept = ["mlflow.db", "data/sources/.gitignore"]
    for name in (*halves, *kept):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("x")
    subprocess.run(["make", "clean"], cwd=tmp_path, check=True, capture_output=True)
    assert files(tmp_path) == sorted([*kept, "Makefile"])
