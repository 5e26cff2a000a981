"""What a test split has of training: captions word for word, motions within 15 mm."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from motionary.corpus.store import Corpus
from motionary.evaluation.copies import copy_statistics, nearest_training_window
from motionary.features import codec
from motionary.motion import Motion, Skeleton, canonicalize
from motionary.report.copy_tables import copies
from motionary.report.results import Results


@pytest.fixture(scope="module")
def corpus(pipeline):
    return Corpus.open(pipeline / "data/corpus")


def test_a_window_is_its_own_nearest_at_any_length_place_and_heading(corpus):
    """The same movement at another length, elsewhere and turned, is a copy; lifted by 10 mm it lies 10 mm away."""
    skeleton, rng = Skeleton.named("smpl22"), np.random.default_rng(0)
    made = codec("humanml3d", skeleton)
    rest = np.zeros((22, 3))
    for joint, parent in enumerate(skeleton.parents[1:], 1):
        rest[joint] = rest[parent] + skeleton.offsets[joint]
    limbs = [
        skeleton.joints.index(f"{side}_{part}") for side in ("left", "right") for part in ("knee", "elbow", "wrist")
    ]
    sway = 0.1 * rng.normal(size=(1, 22, 3)) * np.isin(np.arange(22), limbs)[:, None]  # the facing stays

    def features(frames, lift=0.0, turn=0.0, walk=0.0):
        time = np.linspace(0, 1, frames + 1)[:, None, None]
        positions = rest + sway * np.sin(2 * np.pi * time) + [0, 1, 0] + walk * time * [0, 0, 1]
        c, s = np.cos(turn), np.sin(turn)
        positions = positions @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
        moved = canonicalize(Motion(positions.astype(np.float32), 20.0, skeleton)).positions
        return made.encode(Motion(moved + np.array([0, lift, 0], np.float32), 20.0, skeleton))

    windows = [features(160), features(80, turn=1.0, walk=2.0), features(160, lift=0.01), features(120, lift=1.0)]
    length = np.array([len(w) for w in windows])
    small = SimpleNamespace(
        context=corpus.context,
        frames=np.concatenate(windows),
        clips=SimpleNamespace(length=length, offset=np.cumsum(length) - length),
    )
    found = nearest_training_window(small, np.array([1, 2]), np.array([0, 3]))  # type: ignore[arg-type]
    assert found[0] < 3
    assert found[1] == pytest.approx(10, abs=0.1)


def test_captions_count_where_training_says_the_same_words(corpus):
    found = copy_statistics(corpus)["all"]
    trained = {" ".join(w) for w in corpus.captions.words[np.isin(corpus.captions.clip, corpus.rows("train"))]}
    asked = [" ".join(w) for w in corpus.captions.words[np.isin(corpus.captions.clip, corpus.rows("test"))]]
    assert found["captions"] == len(asked)
    assert found["word_for_word"] == pytest.approx(np.mean([text in trained for text in asked]), abs=1e-4)
    assert found["windows"] == len(corpus.rows("test"))
    assert found["nearest_mm"] > 15 or found["near"] >= 0.5


def test_a_test_split_of_training_windows_is_all_copies(corpus, monkeypatch):
    split = corpus.clips.split.copy()
    rows = corpus.rows("train")
    assert nearest_training_window(corpus, rows[:5], rows) == pytest.approx(0, abs=1e-6)
    split[:] = "test"
    monkeypatch.setattr(corpus, "clips", type(corpus.clips)(**vars(corpus.clips) | {"split": split}))
    assert copy_statistics(corpus) == {}


def test_the_report_shows_them():
    found = {"all": {"captions": 9, "word_for_word": 0.5, "windows": 8, "near": 0.25, "nearest_mm": 31.0}}
    table = copies(Results(stages={"retrieval": {"copies": found}}))
    assert table is not None
    assert table.rows == [["all", "9", "50.0%", "8", "25.0%", "31.0"]]
    assert copies(Results()) is None
