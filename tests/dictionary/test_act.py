"""Motions of actions from Python and the shell, with untrained models of a made corpus."""

from __future__ import annotations

import json

import numpy as np
import pytest
from strides import on_the_floor
from tiny import pipeline  # noqa: F401

from motionary import load
from motionary.cli.commands import main
from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.nn.layers import seeded
from motionary.systems.action2motion.conditioned_vae import Action2Motion, Action2MotionConfig
from motionary.systems.io import save_model


@pytest.fixture(scope="module")
def models(pipeline, tmp_path_factory):  # noqa: F811
    context, folder = Corpus.open(pipeline / "data/corpus").context, tmp_path_factory.mktemp("act") / "models"
    with seeded(0):
        model = Action2Motion(Action2MotionConfig(("sit down", "walk"), width=8, latent=3, upstream=2), context)
    save_model(folder / "action2motion/glmi_m", "action2motion", model, context)
    return folder


@pytest.fixture(scope="module")
def d(models):
    return load(models, "cpu")


def test_actions_and_their_variants(d):
    assert d.actions == ("sit down", "walk")
    first, second = d.act("walk", n=2, seconds=2, seed=3)
    assert first.frames == second.frames == 40
    assert not np.allclose(first.positions, second.positions, atol=1e-3)
    assert np.allclose(d.act("walk", seconds=2, seed=3)[0].positions, first.positions, atol=1e-5)
    assert np.allclose(d.act("walk", seconds=2, seed=3, scale=2)[0].positions, 2 * first.positions, atol=1e-5)


def test_transitions_starts_and_interpolation(d):
    assert d.act(["walk", "sit down"], seconds=[1, 2])[0].frames == 60
    start = d.act("walk", seconds=1)[0]
    (longer,) = d.act("sit down", seconds=2, start=start)
    assert longer.frames == 60
    apart = [np.linalg.norm(p[:, :1] - p[:, 1:], axis=-1) for p in (longer.positions[:20], start.positions)]
    assert np.allclose(*apart, atol=0.02)  # the same poses, put on the floor and turned ahead
    between = d.between_actions("walk", steps=3, seconds=1, seeds=(0, 5), feet=False)
    first, last = (d.act("walk", seconds=1, seed=seed, feet=False)[0].positions for seed in (0, 5))
    assert np.allclose(between[0].positions, first, atol=1e-5)
    assert np.allclose(between[-1].positions[0], last[0], atol=1e-5)


def test_feet_stand_unless_they_shall_not(d):
    raw, planted = (d.act("walk", seconds=2, feet=feet)[0] for feet in (False, True))
    assert np.allclose(planted.positions, on_the_floor(raw.plant_feet()), atol=1e-5)
    assert not np.array_equal(planted.positions, raw.positions)
    raw, planted = (d.act("walk", seconds=1, start=raw, feet=feet)[0] for feet in (False, True))
    assert np.array_equal(planted.positions[:40], raw.positions[:40])
    assert not np.array_equal(planted.positions[40:], raw.positions[40:])


@pytest.mark.parametrize(
    ("given", "rule"),
    [
        ({"action": "fly"}, "action: fly: must be one of sit down, walk"),
        ({"scale": 0}, "scale: 0"),
        ({"n": 0}, "n: 0"),
        ({"seconds": [1, 2]}, "one for each of 1 actions"),
        ({"seconds": 0}, "seconds: 0"),
        ({"start": "walk.bvh"}, "start"),
    ],
)
def test_bad_input_is_one_line(d, given, rule):
    with pytest.raises(InputError, match=rule) as error:
        d.act(**({"action": "walk"} | given))
    assert "\n" not in str(error.value)


def test_the_shell_writes_files(models, tmp_path, capsys):
    common = ["--models", str(models), "--device", "cpu", "--out", str(tmp_path), "--format", "npz"]
    assert main(["act", "walk", "-n", "3", "--seconds", "1", *common, "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["seconds"] for row in rows] == [1.0] * 3
    assert sorted(path.name for path in tmp_path.iterdir()) == ["walk-0.npz", "walk-1.npz", "walk-2.npz"]
    assert (
        main(["act", "sit down", "walk", "--seconds", "1", "2", "--start", str(tmp_path / "walk-0.npz"), *common]) == 0
    )
    assert (tmp_path / "sit-down-walk.npz").is_file()
    assert main(["act", "walk", "--between", "0", "1", "--steps", "2", "--force", *common]) == 0
    assert main(["act", "fly", *common]) == 2
    assert "must be one of sit down, walk" in capsys.readouterr().err
