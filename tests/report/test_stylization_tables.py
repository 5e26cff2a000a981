"""The section on stylization shows the numbers that its stage reported, and is absent without them."""

from __future__ import annotations

import json
from html import unescape

import pytest

from motionary.report.document import render
from motionary.report.results import Results
from motionary.report.style_tables import classifiers_table, stylization_tables
from motionary.report.summary import main_tables, markdown
from motionary.report.tables import summary

PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108000000003a7e9b550000000a49444154789c6360000000020001"
    "48afa4710000000049454e44ae426082"
)


def value(mean, half=0.0):
    return {"mean": mean, "half": half}


REPORT = {
    "evaluator": "abc",
    "styles": ["old", "proud"],
    "repetitions": 30,
    "style_transfer": {
        "held-out combinations": {
            "items": 64,
            "pool": 477,
            "rows": {
                "real motions": {"style_accuracy": value(0.94, 0.011), "content_accuracy": value(0.9)},
                "label-based (S)": {"style_accuracy": value(0.813, 0.02), "geodesic": value(0.25, 0.001)},
            },
        },
        "unlabeled contents": {"items": 9, "pool": 9, "rows": {"prior-based (U)": {"foot_skating": value(0.111)}}},
    },
}
JUDGES = {
    "real": {
        "windows": 50,
        "style": 0.9406,
        "content": 0.9132,
        "cells": {"old, walk": {"windows": 50, "style": 0.3667, "content": 0.5833}},
    }
}


def test_tables_show_the_numbers_given():
    tables = stylization_tables(Results(stages={"style_evaluation": REPORT}))
    assert [t.title for t in tables] == ["Stylization: held-out combinations", "Stylization: unlabeled contents"]
    first = tables[0]
    assert list(first.columns) == ["", "Style accuracy", "Content accuracy", "Geodesic distance, rad"]
    assert [list(row) for row in first.rows] == [
        ["real motions", "0.940 ± 0.011", "0.900", "-"],
        ["label-based (S)", "0.813 ± 0.020", "-", "0.250 ± 0.001"],
    ]
    assert "64 of 477 contents in each of 30 repetitions" in first.note
    assert "mean over 2 styles" in first.note
    judges = classifiers_table(Results(stages={"style_evaluator": JUDGES}))
    assert judges is not None
    assert [list(row) for row in judges.rows] == [
        ["old, walk", "50", "36.7%", "58.3%"],
        ["mean of classes", "50", "94.1%", "91.3%"],
    ]


def test_the_page_has_a_section_with_its_pictures_where_there_is_a_report(tmp_path):
    picture = tmp_path / "style_codes.png"
    picture.write_bytes(PIXEL)
    other = tmp_path / "contexts.png"
    other.write_bytes(PIXEL)
    stages = {"style_evaluation": REPORT, "style_evaluator": JUDGES}
    results = Results(stages=stages, figures={"style_evaluation": [picture], "tokenizer": [other]})
    page = unescape(render(results))
    section = page[page.index("<h2 id='stylization'>") : page.index("<h2 id='pictures'>")]
    for expected in ("0.813 ± 0.020", "0.111", "36.7%", "style codes", "t-SNE"):
        assert expected in section
    assert section.count("data:image/png") == 1
    assert "id='stylization'" not in render(Results())
    assert stylization_tables(Results()) == []
    assert classifiers_table(Results()) is None


def test_summaries_carry_them(tmp_path):
    (tmp_path / "style_evaluation.json").write_text(json.dumps(REPORT))
    results = Results.read(tmp_path)
    assert [t.title for t in main_tables(results)] == ["Stylization: held-out combinations"]
    assert "| label-based (S) | 0.813 ± 0.020 | - | 0.250 ± 0.001 |" in markdown(tmp_path)
    found = summary(results)
    assert found["held-out combinations: label-based (S)"]["style_accuracy"] == pytest.approx(0.813)
    assert found["unlabeled contents: prior-based (U)"] == {"foot_skating": 0.111}
    assert summary(Results(stages={"style_evaluator": JUDGES}))["style_evaluator"]["style_accuracy"] == 0.9406
