"""Windows at their source's rate: read again from the files that they were cut from."""

from __future__ import annotations

import json

import numpy as np
import pytest

from motionary.corpus.config import DataConfig
from motionary.corpus.demo import demo_clip
from motionary.corpus.originals import Originals
from motionary.corpus.preprocess import preprocess
from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.evaluation.items import Items
from motionary.evaluation.sampled_positions import ahead, interpolated, score_positions
from motionary.motion import Motion, resample


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Eight clips at 60 frames a second, captioned from their second half second on, and the corpus at 20."""
    root = tmp_path_factory.mktemp("recorded")
    lines = []
    for number in range(8):
        motion = resample(demo_clip(number)[0], 60)
        np.save(root / f"{number}.npy", motion.positions)
        caption = {"text": f"a person does number {number}", "start": 0.5, "end": motion.duration}
        lines.append({"motion": f"{number}.npy", "fps": 60, "captions": [caption]})
    (root / "clips.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    values = {"source": "folder", "roots": [str(root)], "workers": 1, "ratios": [0.4, 0.1, 0.5], "min_seconds": 1.0}
    config = DataConfig.from_mapping(values)
    preprocess(config, root / "corpus", progress=False)
    return Corpus.open(root / "corpus"), config, root


def test_a_window_is_the_same_movement_with_more_frames(recorded):
    corpus, config, root = recorded
    originals = Originals(corpus, config, root)
    rows = np.flatnonzero(~corpus.clips.mirrored)
    for row in rows:
        original, motion = originals.motion(row), corpus.motion(row)
        assert original.fps == 60
        assert original.frames == 3 * (motion.frames - 1) + 1
        away = ahead(original).positions[::3] - ahead(motion).positions
        assert np.abs(away).max() < 5e-3


def test_generated_joints_are_interpolated_to_the_sources_rate(recorded):
    corpus, config, root = recorded
    items = Items(corpus)
    real = {items.references[i][0].text: motion for i, motion in enumerate(items.motions(items.features))}

    class Aside:
        """The real motion, whose root stands 10 cm aside after the first frame."""

        takes_lengths = True

        def generate(self, sentences, seeds, frames, greedy=False):
            out = []
            for sentence in sentences:
                motion = real[sentence.text]
                away = np.full((motion.frames, 1, 3), [0.1, 0, 0], np.float32)
                away[0] = 0
                out.append(Motion(motion.positions + away, motion.fps, motion.skeleton))
            return out

    report = score_positions(Aside(), items, samples=1, originals=Originals(corpus, config, root))
    assert report["fps"] == 60
    frames = np.array([3 * (motion.frames - 1) + 1 for motion in real.values()])
    # Of the frames between the first and the second of the corpus one is a third on its way, one two thirds.
    expected = 0.1 * (frames - 2).sum() / frames.sum()
    assert report["rows"]["one sample"]["ape_trajectory"]["mean"] == pytest.approx(expected, abs=2e-3)


def test_straight_lines_between_frames_and_the_last_one_held():
    skeleton = demo_clip(0)[0].skeleton
    line = np.arange(4)[:, None, None] * np.ones((1, len(skeleton), 3))
    made = interpolated(Motion(line, 10, skeleton), Motion(np.zeros((9, len(skeleton), 3)), 20, skeleton))
    np.testing.assert_allclose(made.positions[:, 0, 0], [0, 0.5, 1, 1.5, 2, 2.5, 3, 3, 3])


def test_sources_without_more_frames_are_not_read_as_such(pipeline):
    corpus = Corpus.open(pipeline / "data/corpus")
    assert Originals(corpus, DataConfig(clips=24), pipeline).motion(0) is None


def test_a_clip_that_is_gone_is_named(recorded):
    corpus, _, root = recorded
    with pytest.raises(InputError, match=r"must be of a clip in data\.roots"):
        Originals(corpus, DataConfig(), root).motion(0)
