"""Which generator answers: the one that the report found best, where it lies in the folder."""

from __future__ import annotations

import json
import shutil

import pytest

import motionary
from motionary.errors import InputError
from motionary.systems.registry import MOTION_TO_TEXT, TEXT_TO_MOTION


@pytest.fixture
def models(pipeline, tmp_path):
    shutil.copytree(pipeline / "models", tmp_path / "models")
    return tmp_path / "models"


def test_the_report_s_choice_answers_and_the_usual_one_without_a_report(models):
    generators = motionary.load(models, "cpu").offering(TEXT_TO_MOTION)
    assert generators[0] == "text2motion"
    file = models.parent / "reports/preferred.json"
    file.parent.mkdir()
    file.write_text(json.dumps({TEXT_TO_MOTION: "text2token", "fid": {}}))
    d = motionary.load(models, "cpu")
    assert d.offering(TEXT_TO_MOTION)[0] == "text2token"
    assert sorted(d.offering(TEXT_TO_MOTION)) == sorted(generators)
    assert d.offering(MOTION_TO_TEXT)[0] == "motion2text"
    first, told = d.generate("a person walks")[0], d.generate("a person walks", system="text2token")[0]
    assert (first.positions == told.positions).all()
    (models / "preferred.json").write_text(json.dumps({TEXT_TO_MOTION: None}))  # a bundle brings its own
    assert motionary.load(models, "cpu").offering(TEXT_TO_MOTION)[0] == "text2motion"


def test_a_choice_that_is_not_there_or_cannot_be_read(models):
    (models / "preferred.json").write_text(json.dumps({TEXT_TO_MOTION: "elsewhere"}))
    assert motionary.load(models, "cpu").offering(TEXT_TO_MOTION)[0] == "text2motion"
    (models / "preferred.json").write_text("{")
    with pytest.raises(InputError, match=r"preferred\.json: .* must be JSON"):
        motionary.load(models, "cpu").generate("a person walks")
