"""Models on disk."""

from __future__ import annotations

import dataclasses
import json

import pytest
import torch

from motionary.errors import InputError
from motionary.nn.layers import seeded
from motionary.systems.io import Trained, load_model, model_hash, read_record, save_model
from motionary.systems.judges.evaluator import Evaluator, EvaluatorConfig
from motionary.systems.registry import known
from motionary.systems.renamed import _MODELS, _TRAINING
from motionary.systems.tm2t.tokenizer import Tokenizer, TokenizerConfig
from motionary.training.settings import TrainSettings

SMALL = TokenizerConfig(codebook_size=8, code_dim=4, width=8, fine_width=8)


@pytest.fixture
def saved(tmp_path, context):
    with seeded(1):
        model = Tokenizer(SMALL, context).eval()
    save_model(tmp_path / "models" / "tokenizer", "tokenizer", model, context)
    return model, tmp_path / "models"


def test_a_saved_model_comes_back_bit_for_bit(saved, batch):
    model, folder = saved
    again = Trained(folder).load("tokenizer")
    assert not again.training
    assert again.config == model.config
    assert again.context.to_json() == model.context.to_json()
    for name, value in model.state_dict().items():
        assert torch.equal(again.state_dict()[name], value), name
    codes = model.encode(batch.motion, batch.frames)
    assert torch.equal(again.encode(batch.motion, batch.frames), codes)
    assert torch.equal(again.decode(codes), model.decode(codes))


def test_an_evaluator_stands_alone(tmp_path, context, batch):
    config = EvaluatorConfig(8, 8, 8, 8, snippet_width=8, snippet_dim=8)
    with seeded(1):
        model = Evaluator(config, context).eval()
    save_model(tmp_path / "evaluator", "evaluator", model, context)
    again = load_model(tmp_path / "evaluator")
    assert torch.equal(again.embed_motion(batch.motion, batch.frames), model.embed_motion(batch.motion, batch.frames))


def test_loading_draws_nothing_from_the_caller_s_generator(saved):
    state = torch.get_rng_state()
    Trained(saved[1]).load("tokenizer")
    assert torch.equal(torch.get_rng_state(), state)


def test_the_hash_names_the_weights(saved, context):
    model, folder = saved
    first = model_hash(folder / "tokenizer")
    assert len(first) == 12
    save_model(folder / "tokenizer", "tokenizer", model, context)
    assert model_hash(folder / "tokenizer") == first
    with torch.no_grad():
        model.decoder.output.bias[0] += 1
    save_model(folder / "tokenizer", "tokenizer", model, context)
    assert model_hash(folder / "tokenizer") != first
    assert sorted(p.name for p in folder.iterdir()) == ["tokenizer"]  # no temporary folder stays


def test_bad_folders_are_named(saved, tmp_path):
    _, folder = saved
    with pytest.raises(InputError, match=r"config.json"):
        load_model(tmp_path / "nowhere")
    with pytest.raises(InputError, match="saved model"):
        model_hash(tmp_path)
    with pytest.raises(InputError, match=r"must be a trained model; run `dvc repro motion2text` first$"):
        load_model(folder / "motion2text" / "second")
    with pytest.raises(InputError, match=r"must be a trained model$"):
        load_model(folder / "foo")
    path = folder / "tokenizer" / "config.json"
    record = read_record(folder / "tokenizer")
    path.write_text(path.read_text().replace('"width": 8', '"width": 9'))
    with pytest.raises(InputError, match=r"config.json: damaged, .* run `dvc repro tokenizer`$"):
        load_model(folder / "tokenizer")
    for change, rule in (
        ({"system": "no_such_system"}, "must be one of tokenizer"),
        ({"config": {**record["config"], "nonsense": 1}}, "keys of this version"),
        ({"config": {**record["config"], "width": 16}}, "weights that belong"),
        ({"config": {**record["config"], "width": [[1]]}}, "keys of this version.*`dvc repro tokenizer`$"),
        ({"context": {**record["context"], "max_frames": None}}, "config.json: .*keys of this version"),
        ({"context": {**record["context"], "fps": {}}}, "config.json: .*keys of this version"),
    ):
        path.write_text(json.dumps({**record, **change}))
        with pytest.raises(InputError, match=rule):
            load_model(folder / "tokenizer")
    for damaged in ("{", "[" * 100_000):
        path.write_text(damaged)
        with pytest.raises(InputError, match="must be JSON"):
            load_model(folder / "tokenizer")
    path.write_text(json.dumps(record))
    weights = folder / "tokenizer" / "model.safetensors"
    whole = weights.read_bytes()
    turned = bytearray(whole)
    turned[len(whole) * 3 // 4] ^= 1
    for data in (whole[:100], bytes(turned), whole[:-4], b""):
        weights.write_bytes(data)
        with pytest.raises(InputError, match=r"safetensors: .*weights that belong to .*; run `dvc repro tokenizer`$"):
            load_model(folder / "tokenizer")
    weights.write_bytes(whole)
    load_model(folder / "tokenizer")


def test_a_model_saved_with_the_old_names_of_its_keys_loads(saved):
    model, folder = saved
    path = folder / "tokenizer" / "config.json"
    record = json.loads(path.read_text())
    old = {
        "codebook_size": "codes",
        "commitment_weight": "beta",
        "restart_below": "dead",
        "codebook_start": "warm_start",
    }
    record["config"] = {old.get(key, key): value for key, value in record["config"].items()}
    del record["checksum"]  # models of that time had none
    assert {"codes", "beta", "dead", "warm_start"} <= record["config"].keys()
    path.write_text(json.dumps(record))
    again = Trained(folder).load("tokenizer")
    assert again.config == model.config
    assert all(torch.equal(value, again.state_dict()[name]) for name, value in model.state_dict().items())


def test_every_new_name_is_a_key_of_its_system():
    for name, system in known().items():
        if system.config:
            keys = {field.name for field in dataclasses.fields(system.load(system.config))}
            renamed = set(_MODELS.get(name, {}).values())
            assert renamed <= keys, (name, renamed - keys)
            assert not set(_MODELS.get(name, {})) & keys, name
    assert set(_TRAINING.values()) <= {field.name for field in dataclasses.fields(TrainSettings)}
