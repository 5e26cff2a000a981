"""Labeled motions as joints: labels of training, stretches from the origin on, padding."""

from __future__ import annotations

import numpy as np
import pytest
from tiny import pipeline  # noqa: F401

from motionary.corpus.acted import Acted, ActionLabels, lengths_told
from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.motion import Motion
from motionary.motion.facing import heading


@pytest.fixture(scope="module")
def corpus(pipeline):  # noqa: F811
    return Corpus.open(pipeline / "data/corpus")


def test_labels_are_those_of_training(corpus):
    labels, clips = ActionLabels.of(corpus), corpus.clips
    assert set(labels.coarse) == set(clips.action[clips.split == "train"])
    for row in range(len(corpus)):
        known = labels.action[row] >= 0
        assert known == (clips.action[row] in labels.coarse)
        if known:
            assert labels.coarse[labels.action[row]] == clips.action[row]
        if labels.fine_ids[row] >= 0:
            assert labels.fine[labels.fine_ids[row]] == f"{clips.action[row]}/{clips.style[row]}"
    rows = labels.rows(corpus, "train")
    assert (clips.split[rows] == "train").all()


def test_stretches_start_above_the_origin_and_face_ahead(corpus):
    labels = ActionLabels.of(corpus)
    data = Acted(corpus, labels, labels.rows(corpus, "train"), 24)
    batch = data.collate(np.arange(len(data)), np.random.default_rng(0))
    assert batch.joints.shape[1:] == (24, 22, 3)
    assert np.abs(batch.joints[:, 0, 0, [0, 2]].numpy()).max() < 1e-5
    for row in batch.joints.numpy():
        assert abs(heading(Motion(row, 20, corpus.context.skeleton))[0]) < 1e-3
    assert batch.action.tolist() == labels.action[data.rows].tolist()


def test_a_stretch_is_a_turned_piece_of_its_clip(corpus):
    labels = ActionLabels.of(corpus)
    data = Acted(corpus, labels, labels.rows(corpus, "train"), 24, random=False)
    joints = data.collate(np.array([0]), np.random.default_rng(0)).joints.numpy()[0]
    whole = corpus.motion(int(data.rows[0])).positions
    start = (len(whole) - 24) // 2
    piece = whole[start : start + 24]
    assert np.allclose(joints[..., 1], piece[..., 1], atol=1e-6)
    apart = [np.linalg.norm(p[:, :, None] - p[:, None], axis=-1) for p in (joints, piece)]
    assert np.allclose(*apart, atol=1e-5)
    moved = [np.linalg.norm(np.diff(p, axis=0), axis=-1) for p in (joints, piece)]
    assert np.allclose(*moved, atol=1e-5)


def test_short_clips_come_whole(corpus):
    labels = ActionLabels.of(corpus)
    rows = labels.rows(corpus, "train")
    data = Acted(corpus, labels, rows, 10_000)
    assert data.lengths.tolist() == corpus.clips.length[rows].tolist()
    batch = data.collate(np.array([0, 1]), np.random.default_rng(0))
    short = int(batch.frames.argmin())
    assert not batch.joints[short, int(batch.frames[short]) :].any()
    with pytest.raises(InputError, match="window"):
        Acted(corpus, labels, rows, 0)


def test_windows_shorter_than_asked_are_counted_and_said(corpus, capsys):
    labels = ActionLabels.of(corpus)
    rows = labels.rows(corpus, "train")
    frames = np.sort(corpus.clips.length[rows])
    told = {"windows": len(rows), "shorter": 0, "longest": int(frames[-1])}
    assert lengths_told(Acted(corpus, labels, rows, int(frames[0])), "action2motion") == told
    assert capsys.readouterr().out == ""
    middle = int(frames[len(frames) // 2])
    below = int((frames < middle).sum())
    assert 0 < below < len(rows)
    assert lengths_told(Acted(corpus, labels, rows, middle), "action2motion") == {**told, "shorter": below}
    line = (
        f"action2motion: {below} of {len(rows)} training windows are shorter than action2motion.window, {middle} frames"
    )
    assert capsys.readouterr().out == f"{line}; they are padded\n"
    assert lengths_told(Acted(corpus, labels, rows, 10_000), "action_evaluator")["shorter"] == len(rows)
    line = "action_evaluator: no training window is as long as action_evaluator.window, 10000 frames"
    assert capsys.readouterr().out == f"{line}: the longest has {frames[-1]}\n"
