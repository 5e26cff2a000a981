"""Every value of the `data` section is checked, and the shipped files pass."""

import dataclasses

import pytest
import yaml

from motionary.corpus.config import DataConfig
from motionary.errors import InputError

FOLDER = {"source": "folder", "roots": ["somewhere"]}


@pytest.mark.parametrize("name", ["demo", "folder", "humanml3d", "kit", "cmu"])
def test_shipped_files_set_every_key(repository, name):
    values = yaml.safe_load((repository / "conf" / "data" / f"{name}.yaml").read_text())
    assert set(values) == {field.name for field in dataclasses.fields(DataConfig)}
    if name != "demo":
        values["roots"] = ["somewhere"]
    assert DataConfig.from_mapping(values).name == name


@pytest.mark.parametrize(
    "wrong",
    [
        {"frames_per_second": 20},
        {"fps": 0},
        {"fps": float("nan")},
        {"fps": "20"},
        {"fps": True},
        {"min_seconds": 0},
        {"max_seconds": 1.5},
        {"split": "random"},
        {"cut": "halves"},
        {"least_cover": 1.5},
        {"source_weights": ["index"]},
        {"source": "web"},
        {"ratios": [0.8, 0.2]},
        {"ratios": [0.8, 0.1, 0.2]},
        {"ratios": [0, 0.5, 0.5]},
        {"ratios": 0.8},
        {"seed": -1},
        {"seed": 1.5},
        {"mirror": "yes"},
        {"strict": 1},
        {"workers": -1},
        {"min_count": 0},
        {"clips": 0},
        {"name": ""},
        {"roots": "somewhere"},
        {"roots": []},
        {"roots": [3]},
        {"roots": ["a", "a"]},
    ],
)
def test_a_wrong_value_names_its_key(wrong):
    with pytest.raises(InputError) as error:
        DataConfig.from_mapping(FOLDER | wrong)
    assert error.value.what == f"data.{next(iter(wrong))}"


def test_a_weight_below_nothing_names_its_source():
    with pytest.raises(InputError, match=r"data\.source_weights\.index: -1"):
        DataConfig.from_mapping(FOLDER | {"source_weights": {"index": -1}})


def test_the_demo_takes_no_roots():
    with pytest.raises(InputError, match=r"data\.roots"):
        DataConfig.from_mapping({"source": "demo", "roots": ["somewhere"]})
