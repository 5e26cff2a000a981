"""Several prompts, loops, paths, keyframes and parts made anew, with any generator: constraints are met."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest

from motionary.cli.commands import main
from motionary.corpus.demo import demo_clip
from motionary.dictionary import load
from motionary.errors import InputError
from motionary.formats import read_motion
from motionary.motion import Motion, Skeleton, resample, retarget
from motionary.motion.pinning import on_body, placed_at

WALK, WAVE = "a person walks forward", "a person waves with the left hand"


@pytest.fixture(scope="module")
def d(pipeline):
    return load(pipeline / "models", "cpu")


@pytest.fixture(scope="module")
def walk() -> Motion:
    return demo_clip(3)[0]


def steps(motion: Motion) -> np.ndarray:
    return np.linalg.norm(np.diff(motion.positions, axis=0), axis=-1)


def test_several_prompts_become_one_motion(d):
    parts = [row[0] for row in d.generate([WALK, WAVE, WALK], seconds=[2, 1.6, 2])]
    (whole,) = d.generate([WALK, WAVE, WALK], seconds=[2, 1.6, 2], join=True)
    assert [part.frames for part in parts] == [40, 32, 40]
    assert whole.frames == 112
    np.testing.assert_allclose(whole.positions[:25, 0], parts[0].positions[:25, 0], atol=0.02)
    assert steps(whole)[[39, 71]].max() < 2 * max(steps(part).max() for part in parts)
    assert len(d.generate([WALK] * 6, n=2, seconds=9.8, join=True)) == 2


def test_a_loop_can_be_repeated(d):
    for motion in d.generate(WAVE, n=2, seconds=2, loop=True):
        away = (motion.positions[-1, 0] - motion.positions[0, 0]) * [1, 0, 1]
        assert np.linalg.norm(motion.positions[-1] - motion.positions[0] - away, axis=-1).max() < 0.02
        first, last = motion.positions[1] - motion.positions[0], motion.positions[-1] - motion.positions[-2]
        assert np.linalg.norm(last - first, axis=-1).mean() * motion.fps < 0.1


def test_a_path_is_followed(d):
    path = np.array([[0.5, 0], [0.5, 1], [1.5, 2]])
    fine = np.concatenate([np.linspace(a, b, 100) for a, b in pairwise(path)])
    for seconds in (4, None):
        (motion,) = d.generate(WALK, seconds=seconds, path=path)
        away = np.linalg.norm(motion.positions[:, 0, None][..., [0, 2]] - fine, axis=-1).min(1)
        assert away.mean() < 0.05
    assert d.generate([WALK, WAVE], seconds=2, join=True, path=path)[0].frames == 80


def test_keyframes_of_any_rig_are_met(d, walk):
    (plain,) = d.generate(WALK, seconds=3)
    skeleton = Skeleton.named("smpl22")
    own = on_body(retarget(walk.crop(20, 21), skeleton))
    near = placed_at(own, 0, plain.positions[30, 0] + [0.1, 0, 0.1], 0.3)
    kit = retarget(Motion(near.positions, 20, skeleton), Skeleton.named("kit21"))
    for pose, met in ((near, 0.01), (kit, 0.01)):
        (led,) = d.generate(WALK, seconds=3, keyframes={0: plain, 1.5: pose})
        wanted = retarget(pose, skeleton).positions[0]
        assert np.linalg.norm(led.positions[30] - wanted, axis=-1).max() < met
        first = retarget(plain.crop(0, 1), skeleton).positions[0]  # untrained models know no length of bones
        assert np.linalg.norm(led.positions[0] - first, axis=-1).max() < met
        assert steps(led).max() < 0.5


def test_a_span_is_made_anew_and_the_rest_stays(d, walk):
    own = retarget(walk, Skeleton.named("smpl22"))
    made = d.edit(own, WAVE, start=1, end=2.2)
    assert made.frames == own.frames
    outside = np.r_[0:20, 44 : own.frames]
    assert np.array_equal(made.positions[outside], retarget(own, own.skeleton).positions[outside])
    assert np.abs(made.positions[20:44] - own.positions[20:44]).max() > 0.05
    assert steps(made).max() < 0.5
    (start, end) = (d.edit(own, WAVE, start=a, end=b) for a, b in ((0, 1), (own.duration - 1, own.duration)))
    assert np.abs(start.positions[20:] - own.positions[20:]).max() < 1e-5
    assert np.abs(end.positions[: own.frames - 20] - own.positions[: own.frames - 20]).max() < 1e-5


def test_from_one_pose_to_another_and_on(d, walk):
    own = retarget(walk, Skeleton.named("smpl22"))
    last = Motion(own.positions[50:] + np.array([0.5, 0, 0.5]), 20, own.skeleton)
    for first, text in ((own.crop(0, 30), None), (own.crop(29, 30), WALK)):
        made = d.between(first, last, seconds=1, text=text)
        assert made.frames == 21
        np.testing.assert_allclose(made.positions[0], own.positions[29], atol=1e-4)
        np.testing.assert_allclose(made.positions[-1], last.positions[0], atol=1e-4)
        assert steps(made).max() < 0.5
    longer = d.extend(own, seconds=1.3, text=WALK)
    assert longer.frames == own.frames + 26
    np.testing.assert_allclose(longer.positions[: own.frames], own.positions, atol=1e-5)
    assert steps(longer)[own.frames - 1 :].max() < 0.5
    assert d.extend(own, seconds=1).frames == own.frames + 20


@pytest.mark.parametrize(
    ("call", "rule"),
    [
        (lambda d, m: d.generate(WALK, loop=True, path=[[0, 0], [0, 1]]), "loop, path: together: contradict"),
        (lambda d, m: d.generate(WALK, seconds=2, path=[[0, 0], [0, 30]]), "a person runs at most"),
        (lambda d, m: d.generate(WALK, seconds=2, keyframes={3: m}), "keyframes: 3: times must be"),
        (lambda d, m: d.generate(WALK, seconds=2, keyframes={1: m, 1.01: m}), "two poses fall on one frame"),
        (lambda d, m: d.generate(WALK, seconds=2, keyframes={1: "walk.bvh"}), "keyframes at 1 s"),
        (lambda d, m: d.generate(WALK, seconds=2, keyframes=[m]), "must be {seconds: pose}"),
        (lambda d, m: d.generate([WALK] * 21, seconds=2, join=True), "texts: 21 prompts: at most 20"),
        (lambda d, m: d.generate([WALK] * 3, seconds=[1, 2], join=True), "one for each of 3 texts"),
        (lambda d, m: d.generate(WALK, join="yes"), "join: yes: must be True or False"),
        (lambda d, m: d.edit(m, WAVE, 1, 1), "start, end: 1 to 1: must be 0 <= start < end"),
        (lambda d, m: d.edit(m, WAVE, 0, 10**5000), "start, end: 0 to a int: must be 0 <= start < end"),
        (lambda d, m: d.edit(m, WAVE, 1, 1.001), "holds no frame"),
        (lambda d, m: d.generate(WALK, seconds=2, keyframes={1: [m, m]}), "keyframes at 1 s: .*must be one Motion"),
        (lambda d, m: d.generate(WALK, seconds=2, path=[[0, 10**400], [1, 1]]), "path: .*must be points"),
        (lambda d, m: d.generate(WALK, n=2**70), "n: .*at most 10,000"),
        (lambda d, m: d.generate(WALK, temperature="x"), "temperature: x: must be a number"),
        (lambda d, m: d.generate(WALK, temperature=10**400), "temperature: .*must be a number"),
        (lambda d, m: d.generate(WALK, top_k=1.5), "top_k: 1.5: must be a whole number"),
        (lambda d, m: d.generate(WALK, greedy="x"), "greedy: x: must be true or false"),
        (lambda d, m: d.generate(WALK, bogus=1), "bogus: 1: unknown option"),
        (lambda d, m: d.generate(WALK, system=["x"]), r"system: \['x'\]: must be one of"),
        (lambda d, m: d.caption(m, beams=2**70), "beams: .*at most 10,000"),
        (lambda d, m: d.caption(m, consensus=3000), "consensus: 3000: .*at most 1,000"),
        (lambda d, m: d.caption(m, temperature="x"), "temperature: x: must be a number"),
        (lambda d, m: d.search(WALK, k=2**70), "k: .*at most 10,000"),
        (lambda d, m: d.extend([m, m]), "motion: .*must be one Motion"),
        (lambda d, m: load(5), "models: 5: must be the path of a folder"),
        (lambda d, m: load("a" * 5000), "missing: must be a folder of trained models"),
        (lambda d, m: read_motion(None), "path: None: must be the path of a motion file"),
        (lambda d, m: m.crop(0.5, 2.5), r"crop: \(0.5, 2.5\): must be whole numbers"),
        (lambda d, m: m.plant_feet(1.5), "first_frame: 1.5: must be a whole number"),
        (lambda d, m: m.to(None), "rig: None: must be"),
        (lambda d, m: resample(m, "x"), "fps: x: must be frames per second"),
        (lambda d, m: Motion(m.positions, 20, None), "skeleton: None: must be a Skeleton"),
        (lambda d, m: d.edit(m, WAVE, 1, 99), "must be 0 <= start < end"),
        (lambda d, m: d.edit(m, WAVE, 0, m.duration), "is the whole motion"),
        (lambda d, m: d.between(m, m, seconds=0), "seconds: 0"),
        (lambda d, m: d.between(m, far(m), seconds=1), "a person runs 8 m/s"),
        (lambda d, m: d.extend(m, seconds=99), "seconds: 99"),
        (lambda d, m: d.extend(m, text=""), "text"),
    ],
)
def test_bad_input_is_one_line(d, walk, call, rule):
    with pytest.raises(InputError, match=rule) as raised:
        call(d, walk)
    assert "\n" not in str(raised.value)


def far(motion: Motion) -> Motion:
    return Motion(motion.positions + np.array([0, 0, 50]), motion.fps, motion.skeleton)


def test_the_shell_says_the_same(pipeline, walk, tmp_path, capsys):
    models, file = str(pipeline / "models"), str(tmp_path / "walk.npz")
    walk.save(file)
    common = ["--models", models, "--out", str(tmp_path), "--format", "npz", "--json", "--force"]

    def ran(*arguments: str) -> list[dict]:
        assert main([*arguments, *common]) == 0
        return json.loads(capsys.readouterr().out)

    (row,) = ran("generate", WALK, WAVE, "--seconds", "2,1", "--join")
    assert row["seconds"] == 3
    assert len(ran("generate", WALK, WAVE, "--seconds", "2,1", "--no-feet")) == 2
    (row,) = ran("generate", WALK, "--seconds", "2", "--keyframe", f"0={file}", "--keyframe", f"1={file}@0.5")
    assert row["seconds"] == 2
    (row,) = ran("generate", WALK, "--path", "0,0 0,1.5", "--seconds", "2")
    assert read_motion(row["files"][0]).positions[-1, 0, 2] == pytest.approx(1.5, abs=0.2)
    (row,) = ran("edit", file, WAVE, "--start", "1", "--end", "2")
    assert row["seconds"] == pytest.approx(walk.duration, abs=0.06)
    (row,) = ran("edit", file, "--extend", "1")
    assert row["seconds"] == pytest.approx(walk.duration + 1, abs=0.06)
    (row,) = ran("edit", file, "--between", file, "--seconds", "1")
    assert row["seconds"] == pytest.approx(1.05)
    (row,) = ran("generate", WALK, "--greedy", "--guidance", "1", "--top-k", "5", "--seconds", "1")
    for bad in (
        ["edit", file], ["edit", file, "--start", "1"], ["generate", WALK, "--keyframe", "x=y"],
        ["edit", file, "--extend", "0"], ["edit", file, "--between", ""],
        ["edit", file, "--extend", "1", "--seconds", "2"],
        ["generate", WALK, "--style", "old", "--loop"], ["act", "walk", "--steps", "3"],
    ):  # fmt: skip
        assert main([*bad, *common]) == 2
        assert capsys.readouterr().err.count("\n") == 1
