"""Position errors of generators whose offset from the real motions is known."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
import pytest

from motionary.corpus.store import Corpus
from motionary.evaluation.items import Items
from motionary.evaluation.sampled_positions import ERRORS, ahead, score_positions
from motionary.metrics.mmm import JOINTS, SCALE, mmm_joints
from motionary.metrics.position import position_errors, sample_errors
from motionary.motion import Motion, Skeleton


class Drifting:
    """The real motion of a text, whose root drifts to the side by the first digits of the seed, in centimetres."""

    takes_lengths = True

    def __init__(self, items: Items, drift):
        self.real = {items.references[i][0].text: motion for i, motion in enumerate(items.motions(items.features))}
        self.drift = drift

    def generate(self, sentences, seeds, frames, greedy=False):
        made = []
        for sentence, seed, count in zip(sentences, seeds, frames, strict=True):
            motion = self.real[sentence.text]
            assert motion.frames == count  # true durations
            away = np.zeros((count, 1, 3), np.float32)
            away[1:, 0, 0] = 0 if greedy else self.drift(seed)
            made.append(Motion(motion.positions + away, motion.fps, motion.skeleton))
        return made


@pytest.fixture(scope="module")
def items(pipeline):
    found = Items(Corpus.open(pipeline / "data/corpus"))
    _, keep = np.unique([references[0].text for references in found.references], return_index=True)
    for name in ("rows", "features", "captions", "references"):  # texts that repeat have no one real motion here
        setattr(found, name, [getattr(found, name)[i] for i in sorted(keep)])
    return found


def test_rows_curve_and_gain_are_those_of_the_drifts(items):
    report = score_positions(Drifting(items, lambda seed: 0.05 * (1 + seed // 1_000_003)), items, samples=3)
    frames = np.array([len(f) for f in items.features])
    share = (frames - 1).sum() / frames.sum()  # the first frame stands at the origin
    rows = report["rows"]
    for name, drift in {
        "z = 0": 0.0, "one sample": 0.05, "mean of 3": 0.10, "best of 3": 0.05, "worst of 3": 0.15,
    }.items():  # fmt: skip
        for error in ("ape_root", "ape_trajectory", "ape_global"):
            assert rows[name][error]["mean"] == pytest.approx(drift * share, abs=1e-4)
        assert rows[name]["ape_local"]["mean"] == pytest.approx(0, abs=1e-4)
    # Variances of a step from 0 to d in the first of F frames: d^2 (F - 1) / F / (F - 1), plus what it shares with the
    # motion itself, which is small.
    assert rows["worst of 3"]["ave_root"]["mean"] > rows["one sample"]["ave_root"]["mean"] > 0
    assert report["curve"] == pytest.approx([0.05 * share] * 3, abs=1e-4)
    assert report["gain"]["mean"] == pytest.approx(0, abs=1e-6)


def test_the_best_of_more_samples_is_never_worse(items):
    falling = Drifting(items, lambda seed: 0.2 / (1 + seed // 1_000_003))
    report = score_positions(falling, items, samples=4, most=3)
    assert report["items"] == 3
    assert report["curve"] == sorted(report["curve"], reverse=True)
    assert report["curve"][3] == pytest.approx(report["curve"][0] / 4, rel=0.02)
    assert 0 < report["gain"]["low"] <= report["gain"]["mean"] <= report["gain"]["high"]
    assert report["rows"]["best of 4"]["ape_root"]["mean"] == pytest.approx(report["curve"][3])


def test_bodies_of_mmm_are_smaller_and_have_its_joints(items):
    report = score_positions(Drifting(items, lambda seed: 0.5), items, samples=1)
    full, mapped = report["rows"]["one sample"], report["mmm"]["one sample"]
    assert mapped["ape_root"]["mean"] == pytest.approx(SCALE * full["ape_root"]["mean"], rel=1e-4)
    assert mapped["ave_root"]["mean"] == pytest.approx(SCALE**2 * full["ave_root"]["mean"], rel=1e-3)
    skeleton = Skeleton.named("smpl22")
    names = [skeleton.joints[joint] for joint in mmm_joints(skeleton)]
    assert len(names) == len(JOINTS) - 2  # the heels
    assert "spine2" not in names
    assert names[0] == "pelvis"


def test_joints_that_are_left_out_do_not_count():
    skeleton = Skeleton.named("smpl22")
    positions = np.random.default_rng(0).normal(size=(5, 22, 3)).astype(np.float32)
    wrong = positions.copy()
    wrong[:, skeleton.joints.index("spine2")] += 3
    a, b = Motion(wrong, 20, skeleton), Motion(positions, 20, skeleton)
    assert sample_errors(a, b)[3] > 0
    np.testing.assert_allclose(sample_errors(a, b, mmm_joints(skeleton)), 0, atol=1e-7)
    np.testing.assert_allclose(astuple(position_errors([a], [b])), sample_errors(a, b))
    assert len(ERRORS) == 8


def test_only_the_start_is_made_alike(items):
    motion = items.motions(items.features)[0]
    moved = Motion(motion.positions + np.float32([3, 0.2, -1]), motion.fps, motion.skeleton)
    away = ahead(moved).positions - ahead(motion).positions
    np.testing.assert_allclose(away, np.broadcast_to([0, 0.2, 0], away.shape), atol=1e-4)
