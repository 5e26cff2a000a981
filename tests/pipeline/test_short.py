"""What DVC shows of a project's results: a narrow table of numbers, and plots on a page that fetches nothing."""

import functools
import json
import subprocess
import sys

import pytest
import yaml
from browser import launched

from motionary.files import write_bytes
from motionary.pipeline.short import COLUMNS, short


@pytest.fixture(scope="module")
def shown(repository, tmp_path_factory):
    """A folder under DVC with the repository's settings, metrics of every stage and curves of two revisions."""
    root = tmp_path_factory.mktemp("shown")
    params, pipeline = (yaml.safe_load((repository / name).read_text()) for name in ("params.yaml", "dvc.yaml"))
    paths = [path for stage in pipeline["stages"].values() for path in stage.get("do", stage).get("metrics", [])]
    files = sorted({path.replace("${key}", key) for path in paths for key in params["evaluation"]["systems"]})
    widest = {name: 12345 if name == "items" else 0.012345 for name in COLUMNS}
    report = {}
    for name, (place, *_) in COLUMNS.items():
        functools.reduce(lambda part, key: part.setdefault(key, {}), place[:-1], report)[place[-1]] = widest[name]
    for path in files:
        write_bytes(root / path, json.dumps(short(report)))
    curve = "step,train_loss,validation_loss\n1,2.0,\n2,1.0,1.5\n3,0.5,1.25\n"
    write_bytes(root / "reports/figures/tokenizer/curves.csv", curve)
    write_bytes(root / "dvc.yaml", yaml.safe_dump({"metrics": files, "plots": pipeline["plots"]}))
    dvc(root, "init", "--no-scm", "-q")
    for name in ("config", "plots.html"):
        write_bytes(root / ".dvc" / name, (repository / ".dvc" / name).read_bytes())
    return root


def dvc(root, *arguments):
    command = [sys.executable, "-m", "dvc", *arguments]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_all_metrics_fit_into_120_columns(shown):
    head, *rows = dvc(shown, "metrics", "show").splitlines()
    assert sorted(head.split()) == sorted(["Path", *COLUMNS])
    assert len(rows) > 30
    assert max(map(len, [head, *rows])) <= 120
    assert len(COLUMNS) <= 15


def test_the_page_of_plots_fetches_nothing_and_draws_every_curve(shown):
    page = shown / "dvc_plots" / "index.html"
    dvc(shown, "plots", "show")
    asked, errors = [], []
    with launched([]) as browser:
        tab = browser.new_page()
        tab.on("request", lambda request: asked.append(request.url))
        tab.on("pageerror", lambda error: errors.append(str(error)))
        tab.goto(page.as_uri())
        drawn = tab.locator("polyline").evaluate_all("all => all.map(line => line.getAttribute('points'))")
        words = tab.locator("svg text").all_text_contents()
    assert errors == []
    assert asked == [page.as_uri()]
    assert [len(points.split()) for points in drawn] == [3, 2]  # validation has no value at the first step
    assert {"reports/figures/tokenizer/curves.csv", "train_loss", "validation_loss", "step"} <= set(words)
    assert {"0.5", "2", "1", "3"} <= set(words)


def test_numbers_are_found_wherever_a_report_has_them():
    interval, several = {"mean": 0.123456, "half": 0.01}, [{"best_validation_loss": value} for value in (2.5, 1.5)]
    assert short({"training": {"best_validation_loss": 0.123456}, "code": "x"}) == {"loss": 0.1235}
    assert short({"actions": ["a"], "first": several[0], "other": several[1]}) == {"loss": 2.5}
    found = short({"items": 300, "generation": {"all": {"r3": interval, "fid": {"mean": 1234.5}}}})
    assert found == {"items": 300, "r3": 0.123, "fid": 1230}
    rows = {"rows": {"motion-based (S)": {"style_accuracy": interval}}}
    assert short({"style_transfer": {"held-out targets": {"rows": {}}, "test motions": rows}}) == {"acc": 0.123}
    assert short({"note": "nothing to score", "done": True}) == {}


def test_every_stage_declares_the_metrics_that_it_writes(repository):
    """`Stage.report` writes reports/short/ beside a stage's own report."""
    stages = yaml.safe_load((repository / "dvc.yaml").read_text())["stages"]
    for name, stage in stages.items():
        stage = stage.get("do", stage)
        own = [path for path in (f"reports/{name}.json", f"reports/{name}/${{key}}.json") if path in stage["outs"]]
        assert stage.get("metrics", []) == [path.replace("reports/", "reports/short/", 1) for path in own]
        assert bool(own) == (name not in ("code", "source", "report")), name
