"""Stylization by hand and by shell, on untrained models: what is asked is what comes, and bad input is one line."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from shell import call
from strides import on_the_floor
from tiny import add_stylizers

import motionary
from motionary import read_motion
from motionary.corpus.demo import demo_clip
from motionary.errors import InputError
from motionary.motion import Motion, Skeleton, fit_rotations, resample


@pytest.fixture(scope="module")
def models(pipeline, tmp_path_factory) -> Path:
    """The untrained pipeline with stylizers of both settings on the demo corpus's styles."""
    folder = tmp_path_factory.mktemp("styled") / "models"
    shutil.copytree(pipeline / "models", folder)
    add_stylizers(pipeline, folder)
    return folder


@pytest.fixture(scope="module")
def d(models):
    return motionary.load(models, device="cpu")


@pytest.fixture(scope="module")
def walk() -> Motion:
    return demo_clip(3)[0]


def same(a: Motion, b: Motion) -> bool:
    return a.frames == b.frames and np.allclose(a.positions, b.positions, atol=1e-4)


def test_variants_repeat_by_seed_and_alone(d, walk):
    """n variants as long as the motion, each its own draw; company and order change nothing."""
    other = demo_clip(5)[0]
    assert "old" in d.styles
    both = d.stylize([walk, other], style="old", n=2, seed=4)
    assert [[m.frames for m in row] for row in both] == [[walk.frames] * 2, [other.frames] * 2]
    alone = d.stylize(walk, style="old", n=2, seed=4)
    assert all(same(a, b) for a, b in zip(alone, both[0], strict=True))
    assert not same(*alone)
    assert not same(alone[0], d.stylize(walk, style="happy", n=1, seed=4)[0])
    assert not same(alone[0], d.stylize(walk, style="old", seed=5)[0])


def test_feet_stand_unless_they_shall_not(d, walk):
    raw, planted = (d.stylize(walk, style="happy", feet=feet)[0] for feet in (False, True))
    assert np.allclose(planted.positions, on_the_floor(raw.plant_feet()), atol=1e-4)
    assert not same(planted, raw)
    raw, planted = (d.interpolate(walk, "happy", "old", steps=2, feet=feet)[1] for feet in (False, True))
    assert np.allclose(planted.positions, on_the_floor(raw.plant_feet()), atol=1e-4)


def test_any_length_rate_and_rig(d, walk):
    """Longer than any window, at 30 fps, on the rig of KIT: the result lasts as long, at the models' rate and rig."""
    long = Motion(np.concatenate([walk.positions] * 8)[:401], 20.0, walk.skeleton)
    (made,) = d.stylize(long, style="old")
    assert made.frames == 401
    (made,) = d.stylize(resample(walk, 30.0))
    assert abs(made.duration - walk.duration) < 0.11
    kit = motionary.motion.retarget(walk, Skeleton.named("kit21"))
    assert d.stylize(kit, reference=walk)[0].skeleton.name == "smpl22"
    assert d.stylize(walk.crop(0, 2), style="old")[0].frames == 2


def test_stylize_what_was_generated(d):
    """Behind any generator."""
    motions = d.generate("a person walks", n=2, seconds=3)
    assert [[m.frames for m in row] for row in d.stylize(motions, style="old")] == [[60], [60]]


def test_references_with_and_without_label(d, walk):
    """A reference alone is unsupervised; with a style, supervised; equal calls repeat."""
    reference = demo_clip(7)[0]
    free, told = d.stylize(walk, reference=reference)[0], d.stylize(walk, "old", reference)[0]
    assert not same(free, told)
    assert same(told, d.stylize(walk, "old", reference, seed=9)[0])


def test_interpolation_starts_and_ends_at_the_styles(d, walk):
    """Between two names or two references; the ends are what stylize gives."""
    made = d.interpolate(walk, "old", "happy", steps=4, seed=2)
    assert len(made) == 4
    assert same(made[0], d.stylize(walk, "old", seed=2)[0])
    assert same(made[-1], d.stylize(walk, "happy", seed=2)[0])
    a, b = demo_clip(7)[0], demo_clip(9)[0]
    assert same(d.interpolate(walk, a, b, steps=2)[1], d.stylize(walk, reference=b)[0])


@pytest.mark.parametrize(
    ("call", "rule"),
    [
        (lambda d, m: d.stylize(m, style="odd"), "style: odd: must be one of angry, happy, neutral, old, proud, tired"),
        (lambda d, m: d.stylize(m, reference=m.crop(0, 20)), r"reference: 20 frames: must last at least 30 frames"),
        (lambda d, m: d.stylize(m, reference=m, n=2), "a reference gives one motion"),
        (lambda d, m: d.stylize(m, n=0), "n: 0"),
        (lambda d, m: d.stylize(m, seed=-1), "seed: -1"),
        (lambda d, m: d.stylize(m, strength=-0.5), r"strength: -0\.5"),
        (lambda d, m: d.stylize("walk.bvh"), "must be one Motion"),
        (lambda d, m: d.stylize(m, reference="old.bvh"), "reference"),
        (lambda d, m: d.stylize(m.crop(0, 1)), "motion"),
        (lambda d, m: d.interpolate(m, "old", m), "two styles or two motions"),
        (lambda d, m: d.interpolate(m, "old", "happy", steps=1), "steps: 1"),
        (lambda d, m: d.stylize(Motion(np.zeros((40, 2, 3)), 20.0, _stick())), "skeleton stick"),
    ],
)
def test_bad_input_is_one_line(d, walk, call, rule):
    with pytest.raises(InputError, match=rule) as error:
        call(d, walk)
    assert "\n" not in str(error.value)


def _stick() -> Skeleton:
    """A skeleton of two joints that no body has."""
    offsets = np.array([[0, 0, 0], [0, 1, 0]])
    return Skeleton("stick", ("root", "tip"), (-1, 0), offsets, ((0, 1),), (), (0, 1, 0, 1), (0, 1), (0, 1))


def test_without_labels_the_prior_and_references_still_serve(models, walk, tmp_path):
    """Models of a corpus without style labels: a style is refused with the reason, the rest works."""
    for name in ("global_motion", "stylization/unsupervised"):
        shutil.copytree(models / name, tmp_path / "models" / name)
    bare = motionary.load(tmp_path / "models", "cpu")
    assert bare.stylize(walk)[0].frames == bare.stylize(walk, reference=walk)[0].frames == walk.frames
    with pytest.raises(InputError, match="no style labels"):
        bare.stylize(walk, style="old")
    shutil.rmtree(tmp_path / "models/global_motion")
    with pytest.raises(InputError, match="dvc repro global_motion"):
        motionary.load(tmp_path / "models", "cpu").stylize(walk)


def test_files_in_files_out(models, walk, tmp_path, capsys):
    """motionary stylize on a BVH: every format and variant, JSON rows, no file replaced unasked."""
    walk.save(tmp_path / "walk.bvh")
    given = ["stylize", str(tmp_path / "walk.bvh"), "--models", str(models), "--device", "cpu", "--out"]
    out = str(tmp_path / "out")
    code, printed, error = call(capsys, *given, out, "--style", "old", "-n", "2", "--format", "npz,bvh", "--json")
    assert code == 0, error
    rows = json.loads(printed)
    assert [row["variant"] for row in rows] == [0, 1]
    names = [Path(file).name for row in rows for file in row["files"]]
    assert names == ["walk-old-0.npz", "walk-old-0.bvh", "walk-old-1.npz", "walk-old-1.bvh"]
    assert abs(read_motion(rows[0]["files"][0]).duration - walk.duration) < 0.11
    reference = ["--reference", str(tmp_path / "walk.bvh")]
    assert call(capsys, *given, out, *reference)[1].strip().endswith("walk-walk.bvh")
    for wrong, rule in ((["--style", "odd"], "must be one of angry"), (reference, "walk-walk.bvh")):
        code, printed, error = call(capsys, *given, out, *wrong)
        assert (code, printed, error.count("\n")) == (2, "", 1)
        assert rule in error


def test_generate_in_a_style(models, tmp_path, capsys):
    """motionary generate --style: other files than without, and a bad style in one line."""
    given = ["generate", "a person walks", "--seconds", "2", "--format", "npz", "--models", str(models), "--out"]
    assert call(capsys, *given, str(tmp_path / "plain"))[0] == 0
    assert call(capsys, *given, str(tmp_path / "old"), "--style", "old")[0] == 0
    plain, old = (read_motion(tmp_path / name / "a-person-walks.npz") for name in ("plain", "old"))
    assert plain.frames == old.frames
    assert not same(plain, old)
    code, _, error = call(capsys, *given, str(tmp_path / "odd"), "--style", "odd")
    assert code == 2
    assert "must be one of" in error


@pytest.mark.real
def test_real_files_of_other_rigs(d, shared_data):
    """BVH files of four skeletons, at 30 to 120 fps, can be content and reference."""
    files = sorted((shared_data / "bvh").rglob("*.bvh"))
    for path in files[:: max(1, len(files) // 4)][:4]:
        motion = read_motion(path)
        if motion.duration < 1.6:
            motion = Motion(np.concatenate([motion.positions] * 3), motion.fps, motion.skeleton)
        motion = motion.crop(0, min(motion.frames, round(3 * motion.fps)))
        (made,) = d.stylize(motion, style="old", reference=motion)
        assert abs(made.duration - motion.duration) < 0.11
        assert np.isfinite(made.positions).all()


def test_results_return_onto_the_rig_and_rate_of_their_file(d, walk):
    child = fit_rotations(walk)
    child = child.to(child.skeleton.with_offsets(child.skeleton.offsets * 0.7))
    child = resample(child, 30)
    (plain,) = d.stylize(child, "old", seed=3)
    (made,) = d.stylize(child, "old", seed=3, keep_rig=True)
    assert made.skeleton == child.skeleton
    assert made.fps == 30
    assert made.duration == pytest.approx(plain.duration, abs=1 / 20)
    assert np.linalg.norm(made.positions - made.positions[:, :1], axis=-1).max() < 0.75 * 1.4


def test_the_shell_gives_each_file_back_on_its_own_rig(models, walk, tmp_path, capsys):
    child = fit_rotations(walk)
    child = resample(child.to(child.skeleton.with_offsets(child.skeleton.offsets * 0.7)), 30)
    child.save(tmp_path / "child.npz")
    given = ["stylize", str(tmp_path / "child.npz"), "--style", "old", "--format", "npz", "--models", str(models)]
    found = {}
    for name, more in {"own": [], "models": ["--no-keep-rig"]}.items():
        code, printed, error = call(capsys, *given, "--out", str(tmp_path / name), *more)
        assert code == 0, error
        found[name] = read_motion(printed.strip())
    assert found["own"].fps == 30
    np.testing.assert_allclose(found["own"].skeleton.offsets, child.skeleton.offsets, atol=1e-6)
    assert found["models"].fps == 20
    assert found["models"].skeleton.bone_lengths.sum() > 1.3 * child.skeleton.bone_lengths.sum()
