"""The published layout of HumanAct12, made here on a small scale."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from motionary.corpus.acted import ActionLabels
from motionary.corpus.demo import demo_clip
from motionary.corpus.preprocess import preprocess
from motionary.corpus.store import Corpus
from motionary.formats import read_motion

NAMES = (
    "P01G01R01F0001T0064A0101",
    "P01G01R02F0065T0140A0201",
    "P02G02R01F0001T0064A0402",
    "P02G02R01F0070T0133A1201",
    "P03G01R01F0001T0064A0201",
    "P03G01R02F0001T0064A0401",
)
CAMERA = np.array([1, -1, -1], np.float32)  # some copies have a camera's axes, in which y points down


def joints24(index: int) -> np.ndarray:
    """(T, 24, 3) as SMPL has them: the body's 22, and a hand at each wrist."""
    positions = demo_clip(index)[0].positions[:64]
    hands = positions[:, [20, 21]] + 0.5 * (positions[:, [20, 21]] - positions[:, [18, 19]])
    return np.concatenate([positions, hands], axis=1)


@pytest.fixture
def layout(tmp_path):
    folder = tmp_path / "HumanAct12"
    folder.mkdir()
    for index, name in enumerate(NAMES):
        np.save(folder / f"{name}.npy", joints24(index) * (CAMERA if index % 2 else 1))
    return folder


def build(folder, out, **changes):
    settings = {"source": "folder", "roots": [str(folder)], "workers": 1, "mirror": False, "split": "subject"}
    report = preprocess({**settings, "ratios": [0.6, 0.0, 0.4], **changes}, out, progress=False)
    return report, Corpus.open(out)


def test_names_tell_person_action_and_fine_action(layout, tmp_path):
    report, corpus = build(layout, tmp_path / "out")
    assert (report["read"], report["problem_count"]) == (len(NAMES), 0)
    clips = corpus.clips
    told = {name.split("/")[1]: row for row, name in enumerate(clips.origin)}
    assert set(told) == set(NAMES)
    found = [(clips.subject[told[name]], clips.action[told[name]], clips.style[told[name]]) for name in NAMES]
    assert found == [
        ("P01", "warm up", "0101"),
        ("P01", "walk", "0201"),
        ("P02", "jump", "0402"),
        ("P02", "throw", "1201"),
        ("P03", "walk", "0201"),
        ("P03", "jump", "0401"),
    ]
    splits = {person: set(clips.split[clips.subject == person]) for person in ("P01", "P02", "P03")}
    assert all(len(split) == 1 for split in splits.values())  # people are held out whole
    labels = ActionLabels.of(corpus)
    assert set(labels.fine) <= {"warm up/0101", "walk/0201", "jump/0401", "jump/0402", "throw/1201"}
    assert len(labels.coarse) >= 2


def test_the_body_s_joints_are_read(layout):
    for index in (0, 3):
        motion = read_motion(layout / f"{NAMES[index]}.npy")
        np.testing.assert_allclose(motion.positions, joints24(index)[:, :22], atol=1e-5)


def test_an_action_that_the_release_does_not_have_is_a_problem(layout, tmp_path):
    np.save(layout / "P01G01R01F0001T0064A1301.npy", joints24(0))
    np.save(layout / "P01_of_mine.npy", joints24(1))
    report, corpus = build(layout, tmp_path / "out")
    assert report["problem_count"] == 1
    (problem,) = report["problems"]
    assert (problem["value"], problem["rule"]) == ("A1301", "HumanAct12's actions are 01 to 12")
    assert corpus.clips.action[corpus.clips.origin == "HumanAct12/P01_of_mine"].tolist() == [""]


def test_pickled_poses_are_refused(layout, tmp_path):
    (layout / "humanact12poses.pkl").write_bytes(pickle.dumps({"joints3D": [joints24(0)]}))
    with (layout / "P01G01R01F0141T0204A0301.npy").open("wb") as file:
        np.save(file, np.array([{"joints3D": joints24(0)}], dtype=object), allow_pickle=True)
    report, corpus = build(layout, tmp_path / "out")
    assert {name.split("/")[1] for name in corpus.clips.origin} == set(NAMES)
    (problem,) = report["problems"]
    assert "P01G01R01F0141T0204A0301.npy" in problem["file"]
    assert "pickle" in f"{problem['value']} {problem['rule']}"
