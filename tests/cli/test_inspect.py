"""`motionary inspect` says what is in a file and what was decided about it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image

from motionary.cli.commands import main
from motionary.corpus.demo import demo_clip


def test_it_says_what_was_measured(clip, capsys):
    assert main(["inspect", str(clip), "--json"]) == 0
    (told,) = json.loads(capsys.readouterr().out)
    motion = demo_clip(3)[0]
    assert (told["frames"], told["fps"], told["up"], told["mirrored"]) == (motion.frames, 20.0, "y", False)
    assert told["roles"]["pelvis"] == "pelvis"
    assert told["bones"]["left_knee"] == pytest.approx(float(motion.skeleton.bone_lengths[4]), abs=2e-3)
    assert 1.4 < told["stature"] < 2
    assert set(told["evidence"]["up"]) == {"y", "z", "x", "-y", "-z", "-x"}
    assert told["evidence"]["up"]["y"] == 0 or told["probability"]["up"] < 1


def test_what_is_given_is_said_to_be(tmp_path, capsys):
    path = tmp_path / "turned.npy"
    np.save(path, demo_clip(3)[0].positions[..., [0, 2, 1]] * np.array([1, -1, 1], np.float32) * 100)
    assert main(["inspect", str(path), "--fps", "20", "--unit", "cm"]) == 0
    out = capsys.readouterr().out
    assert "  up          z (" in out
    assert "  unit        0.01 m (given)" in out


def test_it_draws_the_clips_in_rows(clip, tmp_path, capsys):
    picture = tmp_path / "seen.png"
    other = clip.with_name("other.bvh")
    demo_clip(4)[0].save(other)
    assert main(["inspect", str(clip), str(other), "--out", str(picture)]) == 0
    assert Image.open(picture).height > 2 * 240
    assert main(["inspect", str(clip), "--out", str(picture)]) == 2
    assert "exists" in capsys.readouterr().err
    assert main(["inspect", str(clip), "--out", str(tmp_path / "seen.jpg")]) == 2


@pytest.mark.parametrize(("name", "way"), [("a.fbx", "Blender"), ("a.TRC", "markers"), ("a.doc", "only .bvh")])
def test_what_is_not_read_is_told_a_way(tmp_path, capsys, name, way):
    (tmp_path / name).write_bytes(b"something")
    assert main(["inspect", str(tmp_path / name)]) == 2
    error = capsys.readouterr().err
    assert way in error
    assert error.count("\n") == 1
