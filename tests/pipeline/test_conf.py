"""Configuration: what is committed is what conf/ composes, and no name breaks DVC."""

import dataclasses
import os
import re
import shutil
import subprocess
import sys

import pytest
import yaml

from motionary.corpus.config import DataConfig
from motionary.errors import InputError, configure
from motionary.pipeline.params import differences, write_params
from motionary.pipeline.tracking import flatten
from motionary.systems.registry import known
from motionary.systems.tm2t.tokenizer import TokenizerConfig
from motionary.training.settings import TrainSettings, model_keys, settings_of

SCALES = ("tiny", "small", "paper", "released", "paper_kit", "released_kit")


def divided(section):
    return configure(TokenizerConfig, model_keys(section), "tokenizer"), settings_of(section, "tokenizer")


def composed(repository, tmp_path, *overrides):
    write_params(repository, tmp_path / "params.yaml", overrides)
    return yaml.safe_load((tmp_path / "params.yaml").read_text())


def test_params_are_the_composed_conf(repository, tmp_path):
    assert composed(repository, tmp_path) == yaml.safe_load((repository / "params.yaml").read_text())
    assert differences(repository) == {}


@pytest.mark.parametrize("scale", SCALES)
def test_every_scale_has_the_same_keys(repository, tmp_path, scale):
    default = flatten(composed(repository, tmp_path))
    values = flatten(composed(repository, tmp_path, f"scale={scale}"))
    assert values["scale"] == scale
    assert values.keys() == default.keys()


def test_a_data_root_reaches_params(repository, tmp_path):
    values = composed(repository, tmp_path, "data=folder", "data.roots=[../a,/b,mocap/c]")
    assert values["data"]["roots"] == ["../a", "/b", "mocap/c"]
    assert values["source"]["roots"] == [str(repository.parent / "a"), "/b", "mocap/c"]


@pytest.mark.parametrize("roots", ["data.roots=7", "data.roots=../a", "data.roots=[1]"])
def test_bad_roots_are_left_to_the_check_that_names_them(repository, tmp_path, roots):
    values = composed(repository, tmp_path, "data=folder", roots)
    assert values["source"]["roots"] == values["data"]["roots"]
    with pytest.raises(InputError, match=r"data\.roots"):
        DataConfig.from_mapping(values["data"])


def test_banned_names(repository, tmp_path):
    # DVC drops "size" and "nfiles" from its run-cache key and would serve stale outputs.
    for key, value in flatten(composed(repository, tmp_path)).items():
        assert not {"size", "nfiles"} & set(key.split(".")), key
        assert value != "???", key
    for file in (repository / "conf").rglob("*.yaml"):
        # DVC's composition cannot resolve Hydra's own values.
        assert "${hydra:" not in file.read_text(), file


def test_stage_files_carry_their_package(repository):
    for file in (repository / "conf").glob("*.yaml"):
        if file.stem != "config" and not file.stem.endswith("study"):
            assert file.read_text().splitlines()[0] == f"# @package {file.stem}", file


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"steps": 0}, "tokenizer.steps"),
        ({"learning_rate": -1.0}, "tokenizer.learning_rate"),
        ({"schedule": "linear"}, "tokenizer.schedule"),
        ({"codez": 5}, "tokenizer.codez"),
        ({"quantizer": "soft"}, "tokenizer.quantizer"),
    ],
)
def test_bad_values_name_their_key(repository, changes, named):
    section = {**yaml.safe_load((repository / "params.yaml").read_text())["tokenizer"], **changes}
    with pytest.raises(InputError, match=named.replace(".", r"\.")):
        divided(section)


@pytest.mark.parametrize("name", [name for name, system in known().items() if system.config])
def test_a_setting_is_explained_where_it_stands_and_nowhere_else(repository, name):
    text, config = (repository / "conf" / f"{name}.yaml").read_text(), known()[name].load(known()[name].config)
    fields = {field.name for field in dataclasses.fields(config)}
    lines = {line.split(":")[0]: line for line in text.splitlines() if re.match(r"\w+:", line)}
    assert [key for key, line in lines.items() if key in fields and "#" not in line] == []
    documented = re.findall(r"^ *([\w, ]+): ", config.__doc__ or "", re.MULTILINE)
    assert {key for keys in documented for key in keys.split(", ")} & lines.keys() == set()


def test_division_loses_no_key(repository):
    section = yaml.safe_load((repository / "params.yaml").read_text())["tokenizer"]
    model, settings = divided(section)
    assert isinstance(settings, TrainSettings)
    kept = {**vars(model), **vars(settings), "window": section["window"], "balance": section["balance"]}
    assert {key: kept[key] for key in section} == section


@pytest.mark.parametrize(
    ("stage", "override", "rule"),
    [
        ("tokenizer", "evaluator.dim=8", "stage tokenizer reads only"),
        ("tokenizer", "tokenizer.nonsense=1", "Could not override"),
        ("tokenizer", "tokenizer.codes=64", "tokenizer.codes: renamed: is called tokenizer.codebook_size now"),
        ("evaluator", "+evaluator.clip=1", "evaluator.clip: renamed: is called evaluator.max_grad_norm now"),
        ("tokenizer", "tokenizer.steps=0", "tokenizer.steps: 0: must be in 1..100000000"),
        ("tokenizer", "seed=-1", "seed: -1: must be a whole number, at least 0"),
        ("evaluator", "seed=1", "stage evaluator reads only"),
        ("evaluator", "evaluator.seed=x", "evaluator.seed: x: must be a whole number, at least 0"),
        ("preprocess", "source.root=x", "stage preprocess reads only preprocess, data, source.roots,"),
    ],
)
def test_a_stage_refuses_what_it_does_not_read(repository, tmp_path, stage, override, rule):
    for name in ("conf", "stages", "src"):
        shutil.copytree(repository / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    command = [sys.executable, f"stages/{stage}.py", override]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode != 0
    assert rule in done.stderr
    assert not (tmp_path / "models").exists()


@pytest.mark.parametrize(
    ("given", "found"),
    [({}, "1000 None"), ({"GOMP_SPINCOUNT": "7"}, "7 None"), ({"OMP_WAIT_POLICY": "active"}, "None active")],
)
def test_waiting_threads_spin_a_bounded_while_unless_the_user_says_otherwise(repository, given, found):
    told = "os.environ.get('GOMP_SPINCOUNT'), os.environ.get('OMP_WAIT_POLICY')"
    code = f"import sys, os; sys.path.insert(0, 'stages'); import _project; print({told})"
    code += "; sys.exit('torch' in sys.modules)"
    kept = {k: v for k, v in os.environ.items() if k not in ("GOMP_SPINCOUNT", "OMP_WAIT_POLICY")}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=repository, env=kept | given, capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == found
    assert done.returncode == 0, "torch was imported before the threads were told how to wait"
