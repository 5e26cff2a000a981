"""The page of blinded comparisons, answered in a real browser, and what its answers say."""

from __future__ import annotations

import json
import re
import subprocess
import sys

import numpy as np
import pytest
from browser import launched

from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.evaluation.items import Items
from motionary.report.blinded import QUESTIONS, Comparison, blinded_page, make_comparisons
from motionary.report.votes import read_votes, wilson

FLAGS = ["--no-sandbox"]


@pytest.fixture(scope="module")
def items(pipeline):
    return Items(Corpus.open(pipeline / "data/corpus"))


@pytest.fixture(scope="module")
def comparisons(items, pipeline):
    return make_comparisons(items, pipeline / "models", "text2motion", "real", count=3, warm_ups=1, catches=1)


@pytest.fixture(scope="module")
def browser():
    with launched(FLAGS) as started:
        yield started


def visit(browser, path, choose, name="ada"):
    """Answers every question by choose(page) -> "left" or "right"; returns the saved answers and what was shown."""
    context = browser.new_context(offline=True)
    page = context.new_page()
    problems, texts = [], []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.goto(path.as_uri())
    page.fill("#rater", name)
    page.click("#begin")
    while page.locator("#asking").is_visible():
        assert page.locator("canvas:visible").count() == 2
        texts.append(page.locator("#text").inner_text())
        page.click(f"#{choose(page)}")
    with page.expect_download() as download:
        page.click("#save")
    saved = json.loads(download.value.path().read_text())
    context.close()
    assert not problems
    return saved, texts


def test_a_visit_ends_in_a_file_whose_interval_is_that_of_its_answers(browser, comparisons, tmp_path):
    path = tmp_path / "page.html"
    path.write_text(blinded_page(comparisons, "text2motion", "real"))
    saved, texts = visit(browser, path, lambda page: "left")
    assert (saved["rater"], saved["a"], saved["b"]) == ("ada", "text2motion", "real")
    assert saved["question"] == QUESTIONS["semantics"][0]
    kinds = [given["kind"] for given in saved["answers"]]
    assert sorted(kinds) == ["catch", "pair", "pair", "pair", "warm-up"]
    assert kinds[0] == "warm-up"
    assert all(given["chosen"] == given["left"] for given in saved["answers"])  # the left one, whosever it was
    assert [text.strip("“”") for text in texts] == [given["text"] for given in saved["answers"]]
    chosen = [given["chosen"] == "a" for given in saved["answers"] if given["kind"] == "pair"]
    share = sum(chosen) / 3
    low, high = wilson(share, 3)
    assert saved["result"] == pytest.approx({"share": share, "low": low, "high": high, "answers": 3}, abs=1e-6)
    (catch,) = (given for given in saved["answers"] if given["kind"] == "catch")
    assert saved["passed"] == (catch["chosen"] == "a")


def test_sides_and_order_are_drawn_anew_and_the_motions_stand_where_the_answer_says(browser, comparisons, tmp_path):
    """Each pair's two motions start at known places of the page; visits differ, and the order of canvases is told."""
    path = tmp_path / "page.html"
    path.write_text(blinded_page(comparisons, "x", "y", "realism"))
    seen, orders = set(), set()
    for _ in range(6):
        places = []

        def look(page, places=places):
            # Marks the canvases in the order of the data before the page moves them about.
            shown = page.locator("section:visible .row figure")
            places.append([figure.get_attribute("data-side") for figure in shown.all()])
            return "left"

        context = browser.new_context(offline=True)
        page = context.new_page()
        page.goto(path.as_uri())
        page.evaluate(
            "document.querySelectorAll('section').forEach((s) => s.querySelectorAll('figure')"
            ".forEach((f, i) => { f.dataset.side = 'ab'[i]; }))"
        )
        page.click("#begin")
        while page.locator("#asking").is_visible():
            assert page.locator("#text").inner_text() == ""  # realism shows no text
            page.click(f"#{look(page)}")
        with page.expect_download() as download:
            page.click("#save")
        answers = json.loads(download.value.path().read_text())["answers"]
        context.close()
        assert [side[0] for side in places] == [given["left"] for given in answers]
        seen |= {(given["id"], given["left"]) for given in answers}
        orders.add(tuple(given["id"] for given in answers))
    assert len(orders) > 1
    assert len(seen) > len(comparisons)  # some pair stood on both sides


def test_the_page_needs_no_network_and_does_not_tell_whose_motions_these_are(comparisons):
    html = blinded_page(comparisons, "secret_system", "real")
    assert not re.search(r'(src|href)\s*=\s*["\']?(https?:)?//', html)
    assert "secret_system" not in html
    for comparison in comparisons:
        assert comparison.text not in html


def test_catch_trials_have_a_plain_answer(items, pipeline, comparisons):
    (mismatched,) = (c for c in comparisons if c.kind == "catch")
    assert not np.allclose(mismatched.a.positions[0], mismatched.b.positions[0], atol=1e-3)
    made = make_comparisons(items, pipeline / "models", "real", "real", "realism", 2, 0, 1)
    (shaken,) = (c for c in made if c.kind == "catch")
    steps = [np.abs(np.diff(motion.positions, axis=0)).mean() for motion in (shaken.a, shaken.b)]
    assert steps[1] > 3 * steps[0]
    pairs = [c for c in made if c.kind == "pair"]
    assert all(np.array_equal(c.a.positions, c.b.positions) for c in pairs)  # real beside real


def answers(tmp_path, name, chosen, caught="a", **head):
    given = [{"id": i, "kind": "pair", "chosen": side} for i, side in enumerate(chosen)]
    given += [{"id": 90, "kind": "warm-up", "chosen": "b"}, {"id": 91, "kind": "catch", "chosen": caught}]
    path = tmp_path / f"{name}.json"
    path.write_text(json.dumps({"question": "Which?", "a": "x", "b": "y", "answers": given, **head}))
    return path


def test_majorities_decide_ties_are_halves_and_inattentive_raters_do_not_count(tmp_path):
    files = [
        answers(tmp_path, "one", "aaba"), answers(tmp_path, "two", "abba"),
        answers(tmp_path, "asleep", "bbbb", caught="b"),
    ]  # fmt: skip
    verdict = read_votes(files)
    # Text by text: a, a tie, b, a.
    assert (verdict.share, verdict.texts, verdict.raters, verdict.rejected) == (0.625, 4, 2, 1)
    assert (verdict.low, verdict.high) == wilson(0.625, 4)
    assert verdict.low < 0.625 < verdict.high


def test_wilsons_interval_is_the_known_one():
    # Statsmodels' proportion_confint(8, 10, method="wilson").
    assert wilson(0.8, 10) == pytest.approx((0.490162, 0.943318), abs=1e-5)
    assert wilson(0.0, 5)[0] == pytest.approx(0, abs=1e-12)
    assert wilson(1.0, 5)[1] == pytest.approx(1, abs=1e-12)


def test_bad_input_is_one_line(tmp_path, items, pipeline, comparisons):
    (tmp_path / "no.json").write_text("{}")
    with pytest.raises(InputError, match="saved"):
        read_votes([tmp_path / "no.json"])
    mixed = [answers(tmp_path, "one", "a"), answers(tmp_path, "other", "a", b="z")]
    with pytest.raises(InputError, match="one page"):
        read_votes(mixed)
    with pytest.raises(InputError, match="passed"):
        read_votes([answers(tmp_path, "asleep", "a", caught="b")])
    with pytest.raises(InputError, match="must hold a pair"):
        blinded_page([Comparison("t", comparisons[0].a, comparisons[0].b, "catch")], "x", "y")
    with pytest.raises(InputError, match="at most"):
        make_comparisons(items, pipeline / "models", "real", "real", count=10_000)


def test_the_commands(pipeline, tmp_path):
    out = tmp_path / "page.html"
    command = [sys.executable, "-m", "motionary.report.blinded", "--root", str(pipeline), "--out", str(out)]
    done = subprocess.run([*command, "--a", "real", "--b", "nobody", "--texts", "2"], capture_output=True, text=True)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "nobody" in done.stderr
    done = subprocess.run([*command, "--a", "real", "--b", "real", "--texts", "2"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert out.read_text().startswith("<!doctype html>")
    done = subprocess.run(
        [*command[:-2], "--a", "real", "--b", "real", "--texts", "2"], capture_output=True, text=True, cwd=tmp_path
    )
    assert done.stdout == "out/blinded.html\n"
    assert (tmp_path / "out/blinded.html").is_file()
    votes = [sys.executable, "-m", "motionary.report.votes", str(answers(tmp_path, "one", "ab"))]
    done = subprocess.run(votes, capture_output=True, text=True)
    assert "x rather than y: 50.0%" in done.stdout
