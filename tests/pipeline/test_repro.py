"""`make repro`: independent stages side by side, with what DVC alone would do."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest
import yaml

from motionary.pipeline.lacking import lacking, told
from motionary.pipeline.repro import main, outdated, schedule

STAGE = """
import pathlib, sys, time
name, *inputs = sys.argv[1:]
log = open("log", "a", buffering=1)
log.write(f"start {name}\\n")
try:
    time.sleep(float(pathlib.Path("seconds").read_text()))
except KeyboardInterrupt:
    log.write(f"stopped {name}\\n")
    raise
text = name + "".join(pathlib.Path(path).read_text() for path in inputs)
assert "x" not in text, "bad source"
pathlib.Path(name).write_text(text)
log.write(f"end {name}\\n")
"""


class Ends:
    """A process that ends with `code` at the `after`-th look."""

    def __init__(self, after, code=0):
        self.after, self.code = after, code

    def poll(self):
        self.after -= 1
        return self.code if self.after < 0 else None


def run(needs, jobs, lasts=None, codes=None):
    """The events of a schedule whose processes last as many looks as `lasts` says."""
    events = []

    def start(stage, slot, alone):
        events.append((stage, slot, alone))
        return Ends((lasts or {}).get(stage, 0), (codes or {}).get(stage, 0))

    failed, _ = schedule(needs, start, jobs, wait=lambda: None)
    return events, failed


DIAMOND = {"a": set(), "b": {"a"}, "c": {"a"}, "d": {"a", "b", "c"}}


def test_one_at_a_time_is_an_order_of_the_graph():
    events, failed = run(DIAMOND, jobs=1)
    assert [stage for stage, _, _ in events] == ["a", "b", "c", "d"]
    assert not failed


def test_independent_stages_run_together_and_know_when_they_are_alone():
    events, _ = run(DIAMOND, jobs=2, lasts={"b": 5, "c": 2})
    assert events == [("a", 0, True), ("b", 0, False), ("c", 1, False), ("d", 0, True)]


def test_what_holds_up_most_goes_first_and_a_freed_slot_is_used():
    needs = {"leaf": set(), "trunk": set(), "other": set(), "late": {"trunk"}}
    events, _ = run(needs, jobs=2, lasts={"trunk": 1, "leaf": 9, "other": 1, "late": 1})
    assert events == [("trunk", 0, False), ("leaf", 1, False), ("late", 0, False), ("other", 0, False)]


def test_what_cannot_be_trained_and_what_stands_on_it_are_left_out():
    needs = {"a": set(), "b": {"a"}, "c": {"a", "b"}, "d": {"a"}}
    started = []

    def start(stage, slot, alone):
        started.append(stage)
        return Ends(0)

    found = schedule(needs, start, 2, lambda: None, lambda done: {"b"} if "a" in done else set())
    assert found == ([], {"b", "c"})
    assert started == ["a", "d"]


def test_a_corpus_without_captions_trains_what_reads_no_text(tmp_path):
    assert lacking(tmp_path) == {}
    (tmp_path / "data/corpus").mkdir(parents=True)
    (tmp_path / "data/corpus/report.json").write_text('{"captions": 0}')
    (tmp_path / "data/corpus/context.json").write_text('{"styles": ["old", "young"], "actions": []}')
    lacks = lacking(tmp_path)
    assert {"evaluator", "joint_evaluator", "motion2text", "text2token", "text2length", "temos"} <= set(lacks)
    assert not set(lacks) & {"autoencoder", "tokenizer", "latents", "global_motion", "stylization", "style_evaluator"}
    assert lacks["action2motion"] == "action labels"
    assert told(lacks, {"evaluator", "action2motion", "report"}).splitlines() == [
        "left out for want of captions in clips.jsonl (docs/data.md): evaluator",
        "left out for want of action labels in clips.jsonl (docs/data.md): action2motion",
        "left out with them, since they stand on them: report",
    ]


def test_after_a_failure_nothing_new_starts_and_what_runs_may_end():
    events, failed = run(DIAMOND, jobs=2, lasts={"c": 9}, codes={"b": 1})
    assert failed == ["b"]
    assert [stage for stage, _, _ in events] == ["a", "b", "c"]


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A DVC project of four stages; each adds a line to `log` when it starts and when it ends."""
    (tmp_path / "stage.py").write_text(STAGE)
    (tmp_path / "source").write_text("s")
    (tmp_path / "seconds").write_text("1.5")
    needs = {"a": ["source"], "b": ["a"], "c": ["a"], "d": ["b", "c"]}
    stages = {
        name: {"cmd": f"{sys.executable} stage.py {name} {' '.join(deps)}", "deps": deps, "outs": [name]}
        for name, deps in needs.items()
    }
    (tmp_path / "dvc.yaml").write_text(yaml.safe_dump({"stages": stages}))
    subprocess.run([sys.executable, "-m", "dvc", "init", "--no-scm", "-q"], cwd=tmp_path, check=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def log(project):
    file = project / "log"
    return file.read_text().splitlines() if file.exists() else []


def test_a_project_is_brought_up_to_date_side_by_side(project, capfd):
    assert main(["--jobs", "2"]) == 0
    assert (project / "d").read_text() == "dbascas"
    middle = log(project)[2:6]
    assert sorted(middle[:2]) == ["start b", "start c"]  # both before either ended
    (project / "log").unlink()
    assert main(["--jobs", "2"]) == 0
    assert not log(project)
    assert "up to date" in capfd.readouterr().out
    status = subprocess.run([sys.executable, "-m", "dvc", "status", "--json"], capture_output=True, check=True)
    assert status.stdout.strip() == b"{}"  # DVC agrees


def test_only_what_changed_runs_again(project):
    assert main(["--jobs", "2"]) == 0
    (project / "log").unlink()
    (project / "b").unlink()
    assert outdated(project) == {"b": set(), "d": {"b"}}
    assert main([]) == 0
    assert not log(project)  # the cache still has it


def test_what_dvc_always_runs_goes_first_and_is_no_work(project, capfd):
    """As the stage `code`: it takes stock of what changed, here of the first letter of a file."""
    pipeline = yaml.safe_load((project / "dvc.yaml").read_text())
    take = "open('.code', 'w').write(open('text').read()[0]); open('stock', 'a').write('.')"
    pipeline["stages"]["code"] = {"cmd": f'{sys.executable} -c "{take}"', "always_changed": True}
    pipeline["stages"]["code"]["outs"] = [{".code": {"cache": False, "persist": True}}]
    pipeline["stages"]["b"]["deps"].append(".code")
    (project / "dvc.yaml").write_text(yaml.safe_dump(pipeline))
    (project / "seconds").write_text("0")
    (project / "text").write_text("first")
    assert main([]) == 0
    (project / "log").unlink()
    (project / "text").write_text("fist")
    assert main([]) == 0
    assert not log(project)
    assert "up to date" in capfd.readouterr().out
    (project / "text").write_text("second")
    assert main([]) == 0
    assert log(project) == ["start b", "end b"]  # what b wrote is what it was before, so that d stays
    assert (project / "stock").read_text() == "..."


def test_a_failed_stage_ends_the_run_and_the_next_goes_on(project, capfd):
    (project / "source").write_text("x")
    assert main(["--jobs", "2"]) == 1
    assert "error: a failed" in capfd.readouterr().err
    assert log(project) == ["start a"]
    (project / "source").write_text("s")
    assert main(["--jobs", "2"]) == 0
    assert (project / "d").exists()


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_stopped_run_leaves_no_process_behind(project, sent, code):
    (project / "seconds").write_text("600")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    # As a shell starts what it runs in the background.
    ignoring = (
        "import os, signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN); os.execv(sys.argv[1], sys.argv[1:])"
    )
    command = [sys.executable, "-c", ignoring, sys.executable, "-m", "motionary.pipeline.repro"]
    process = subprocess.Popen(command, env=environment)
    deadline = time.monotonic() + 300
    while log(project) != ["start a"]:
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.2)
    process.send_signal(sent)
    assert process.wait(timeout=300) == code
    assert log(project) == ["start a", "stopped a"]
    assert not (project / "a").exists()


def alive(project):
    """Processes that work in the project."""
    import psutil

    found = []
    for process in psutil.process_iter():
        try:
            if process.pid != os.getpid() and process.cwd() == str(project) and process.status() != "zombie":
                found.append(process)
        except psutil.Error:
            continue
    return found


def until(holds, seconds=120):
    deadline = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.1)


def test_a_killed_run_takes_its_stages_along(project):
    (project / "seconds").write_text("600")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen([sys.executable, "-m", "motionary.pipeline.repro"], env=environment)
    until(lambda: log(project) == ["start a"])
    process.kill()
    process.wait()
    until(lambda: not alive(project))
    assert log(project) == ["start a", "stopped a"]
    (project / "seconds").write_text("0")
    assert main([]) == 0  # and the next one goes on
    assert (project / "d").exists()


def test_a_run_waits_for_what_a_killed_one_left(project, capfd):
    (project / "seconds").write_text("3")
    other = subprocess.Popen([sys.executable, "-m", "dvc", "repro", "-q", "-s", "a"])
    until(lambda: log(project) == ["start a"])
    (project / "seconds").write_text("0")
    assert main([]) == 0
    assert other.wait() == 0
    said = capfd.readouterr().err
    assert f"process {other.pid} of an earlier run still runs here" in said
    assert "rwlock" not in said
    assert log(project)[:2] == ["start a", "end a"]
    assert log(project).count("start a") == 1  # what it did is not done again


def test_a_number_that_another_process_has_got_blocks_nothing(project):
    (project / "seconds").write_text("0")
    (project / ".dvc" / "tmp").mkdir(exist_ok=True)
    with subprocess.Popen([sys.executable, "-c", "import sys; sys.stdin.read()"], stdin=-1) as stranger:
        record = {"pid": stranger.pid, "cmd": "dvc repro a"}
        lock = {"write": {str(project / "a"): record}, "read": {str(project / "source"): [record]}}
        (project / ".dvc" / "tmp" / "rwlock").write_text(json.dumps(lock))
        assert main([]) == 0
        stranger.stdin.close()
    assert (project / "d").exists()


def test_a_pipeline_that_dvc_cannot_read_is_one_line(project, capsys):
    (project / "dvc.yaml").write_text("stages: {a: {cmd: x, nonsense: 1}}\n")
    assert main([]) == 2
    assert "dvc.yaml' validation failed" in capsys.readouterr().err


def test_bad_arguments(project, capsys, monkeypatch, tmp_path_factory):
    assert main(["--jobs", "0"]) == 2
    assert "error: --jobs: 0: must be at least 1" in capsys.readouterr().err
    monkeypatch.chdir(tmp_path_factory.mktemp("empty"))
    assert main([]) == 2
    assert "dvc.yaml" in capsys.readouterr().err
