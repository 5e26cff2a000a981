"""A sweep as a whole: its table, whatever became of its jobs, and bars of several jobs at once."""

import contextlib
import io
import json

import yaml
from tqdm import tqdm

from motionary.pipeline.sweep import JobLines, own_lines, table


def job(folder, number, overrides, report=None):
    (folder / str(number) / ".hydra").mkdir(parents=True)
    (folder / str(number) / ".hydra" / "overrides.yaml").write_text(yaml.safe_dump(overrides))
    if report is not None:
        (folder / str(number) / "reports").mkdir()
        (folder / str(number) / "reports" / "tokenizer.json").write_text(json.dumps(report))


def trained(best, last):
    return {"steps": 9, "best_validation_loss": best, "validation_loss": last}


def test_the_table_names_what_was_swept_lowest_loss_first(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for number, (width, best) in enumerate([(8, 0.25), (16, 0.125), (32, None)]):
        report = None if best is None else {"codes": {"used": 3}, "training": trained(best, 0.5)}
        job(tmp_path / "day" / "time", number, ["scale=small", f"tokenizer.width={width}"], report)
    assert table(tmp_path / "day" / "time", "tokenizer").splitlines() == [
        "tokenizer.width  best validation loss  last  folder",
        "16               0.125                 0.5   day/time/1",
        "8                0.25                  0.5   day/time/0",
        "32               no result             -     day/time/2",
        'curves: make mlflow, experiment tokenizer, the runs below "sweep day time"',
    ]


def test_models_of_one_stage_stand_apart(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for number, best in enumerate([2.0, 1.0]):
        job(tmp_path / "a", number, [f"seed={number}"], {"free": trained(best, 3), "labeled": trained(best / 4, 4)})
    head, *rows, _ = [line.split("  ") for line in table(tmp_path / "a", "tokenizer").splitlines()]
    assert [part.strip() for part in head if part] == ["seed", "model", "best validation loss", "last", "folder"]
    assert [[part.strip() for part in row if part][:3] for row in rows] == [
        ["1", "free", "1"],
        ["0", "free", "2"],
        ["1", "labeled", "0.25"],
        ["0", "labeled", "0.5"],
    ]


def test_a_stage_that_trains_nothing_has_a_table_of_folders(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    job(tmp_path / "a", 0, ["seed=1"], {"scores": {"fid": 1.0}})
    assert table(tmp_path / "a", "tokenizer").splitlines()[1].split() == ["1", "-", "-", "a/0"]
    job(tmp_path / "b", 0, ["seed=1"])
    (tmp_path / "b/0/reports/evaluation").mkdir(parents=True)
    (tmp_path / "b/0/reports/evaluation/tokenizer.json").write_text('{"items": 3}')
    assert table(tmp_path / "b", "evaluation").splitlines()[1].split() == ["1", "-", "-", "b/0"]
    assert table(tmp_path / "nothing", "tokenizer") == ""


def test_a_bar_beside_others_comes_in_lines_and_not_too_often():
    seen = io.StringIO()
    with contextlib.redirect_stderr(JobLines(seen, "#3", seconds=1000)):
        for _ in tqdm(range(50), desc="steps", mininterval=0, miniters=1):
            pass
        tqdm.write("warning: one\nwarning: two", file=JobLines(seen, "#3"))
    first, last, *warnings = seen.getvalue().splitlines()
    assert first.startswith("#3 steps:   0%|")
    assert last.startswith("#3 steps: 100%|")
    assert warnings == ["#3 warning: one", "#3 warning: two"]
    assert "\r" not in seen.getvalue()


def test_a_bar_goes_on_telling():
    seen = io.StringIO()
    lines = JobLines(seen, "#0", seconds=0)
    for part in ("\r 1%", "\r 2%", "\r100%", "\n"):
        lines.write(part)
    assert seen.getvalue().splitlines() == ["#0  1%", "#0  2%", "#0 100%"]


def test_outside_of_a_sweep_bars_stay_as_they_are(capsys):
    with own_lines():
        for _ in tqdm(range(3)):
            pass
    assert "\r" in capsys.readouterr().err
