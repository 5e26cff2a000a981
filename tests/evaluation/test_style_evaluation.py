"""The stylization protocol: floors and ceilings come out as such, for stylizers whose quality is known."""

from __future__ import annotations

import numpy as np
import pytest
from styled import Copier, Perfect, styled_corpus
from tiny import add_stylizers

from motionary.corpus.cells import style_split
from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.evaluation.style_draws import HELD_OUT, TARGETS, TEST, UNLABELED, Drawer
from motionary.evaluation.style_figures import draw_codes, many_styles
from motionary.evaluation.style_measures import local_rotations, spread, turned
from motionary.evaluation.style_scores import (
    CELL,
    COPIED_ROOT,
    COPY,
    PLANTED,
    REAL,
    STYLE,
    StyleProtocol,
    score_stylization,
)
from motionary.metrics.physics import MEASURES
from motionary.systems.judges.style_evaluator import StyleJudge

PROTOCOL = StyleProtocol(repetitions=4, contents=10, diversity_contents=3, diversity_samples=3, pose_step=8)
BOTH = ("supervised", "unsupervised")
WAYS = ("motion-based (S)", "label-based (S)", "motion-based (U)", "prior-based (U)")


class TrueJudge:
    """Names the label of the real motion that a motion was cut from: features are what the corpus knows of it."""

    def __init__(self, corpus, trained=True):
        self.corpus, self.trained, self.hash = corpus, trained, "truth"

    def _rows(self, features):
        starts = np.stack([self.corpus.features(i)[0] for i in range(len(self.corpus.clips.length))])
        return np.array([np.abs(starts - f[0]).sum(1).argmin() for f in features])

    def _judge(self, labels, features, classes):
        logits = np.eye(classes + 1)[labels[self._rows(features)]][:, :classes]
        return logits, logits + 0.01 * np.stack([f[0, :classes] for f in features])

    def style(self, features):
        return self._judge(self.corpus.style_ids, features, 4)

    def content(self, features):
        return self._judge(self.corpus.action_ids, features, 4)


@pytest.fixture(scope="module")
def context(pipeline):
    return Corpus.open(pipeline / "data/corpus").context


@pytest.fixture(scope="module")
def corpus(context):
    return styled_corpus(context)


@pytest.fixture(scope="module")
def split(corpus):
    return style_split(corpus, 0.3, 10)


def score(stylizer, corpus, split, settings=BOTH, judge=None, protocol=PROTOCOL):
    found = score_stylization(stylizer, judge or TrueJudge(corpus), corpus, split, protocol, settings)
    return {part: values["rows"] for part, values in found.items()}


@pytest.fixture(scope="module")
def perfect(corpus, split):
    stylizer = Perfect(corpus)
    return score(stylizer, corpus, split)[HELD_OUT], stylizer


def mean(rows, row, metric):
    return rows[row][metric]["mean"]


def test_a_perfect_stylizer_meets_the_ceiling(perfect):
    rows, _ = perfect
    for way in WAYS[:3]:
        assert mean(rows, way, "style_accuracy") == mean(rows, CELL, "style_accuracy") == 1
        assert mean(rows, way, "content_accuracy") == mean(rows, CELL, "content_accuracy") == 1
        assert mean(rows, way, "style_fid") < 0.02 < 1 < mean(rows, COPY, "style_fid")
    assert mean(rows, REAL, "style_accuracy") == mean(rows, REAL, "content_accuracy") == 1
    assert mean(rows, STYLE, "style_accuracy") == 1
    assert mean(rows, STYLE, "content_accuracy") < 0.7


def test_a_copier_meets_the_floor_of_style_and_the_ceiling_of_content(corpus, split):
    rows = score(Copier(), corpus, split)[HELD_OUT]
    for way in WAYS[:3]:
        assert rows[way]["style_accuracy"] == rows[COPY]["style_accuracy"] == {"mean": 0, "half": 0}
        assert mean(rows, way, "content_accuracy") == 1
        assert mean(rows, way, "content_fid") == pytest.approx(0, abs=1e-6)
        assert mean(rows, way, "geodesic") == 0
        for measure in MEASURES:
            assert mean(rows, way, measure) == mean(rows, COPY, measure)
    for way in ("label-based (S)", "prior-based (U)"):
        assert rows[way]["diversity"] == {"mean": 0, "half": 0}


def test_rows_say_what_was_asked(perfect):
    rows, stylizer = perfect
    ablated = [f"{way} {COPIED_ROOT}" for way in (WAYS[0], WAYS[2])]
    planted = [PLANTED.format(way) for way in WAYS]
    assert set(rows) == {REAL, COPY, STYLE, CELL, *WAYS, *ablated, *planted}
    assert all(mean(rows, made, "bone_change") < 1e-4 for made in planted)
    assert set(stylizer.asked) == {
        ("supervised", True, True, True), ("supervised", True, True, False), ("supervised", True, False, True),
        ("unsupervised", False, True, True), ("unsupervised", False, True, False), ("unsupervised", False, False, True),
    }  # fmt: skip
    assert "diversity" not in rows["motion-based (S)"]
    assert mean(rows, "label-based (S)", "diversity") > 0
    assert not {"style_accuracy", "style_fid"} & set(rows["prior-based (U)"])
    assert all(value["half"] >= 0 for row in rows.values() for value in row.values())


def test_held_out_targets_are_scored_apart(corpus, split):
    rows = score(Perfect(corpus), corpus, split, ("supervised",), protocol=StyleProtocol(2, 8, 2, 2))[TARGETS]
    assert mean(rows, "label-based (S)", "style_accuracy") == mean(rows, "label-based (S)", "content_accuracy") == 1
    assert mean(rows, REAL, "style_accuracy") == 1
    assert not any(COPIED_ROOT in row for row in rows)


def test_unlabeled_contents_have_no_content_accuracy(corpus, split):
    corpus = styled_corpus(corpus.context, bare=16)
    rows = score(Copier(), corpus, style_split(corpus, 0.3, 10))[UNLABELED]
    for row in (COPY, STYLE, *WAYS[:3]):
        assert "content_accuracy" not in rows[row]
        assert "style_accuracy" in rows[row]
    assert CELL not in rows
    assert "style_accuracy" not in rows[REAL]
    assert not any(COPIED_ROOT in row for row in rows)


def test_without_labels_the_unsupervised_setting_is_measured_alone(context):
    corpus = styled_corpus(context, labels=False, bare=16)
    split = style_split(corpus)
    found = score(Copier(), corpus, split, BOTH, TrueJudge(corpus, trained=False))
    assert set(found) == {TEST}
    rows = found[TEST]
    assert {"motion-based (U)", "prior-based (U)"} <= set(rows)
    assert not any("(S)" in row for row in rows)
    assert set(rows["motion-based (U)"]) == {"geodesic", *MEASURES}
    none = styled_corpus(context, labels=False, bare=1)
    with pytest.raises(InputError, match="no content"):
        score(Copier(), none, style_split(none), BOTH, TrueJudge(none, trained=False))


def test_draws_ask_for_other_styles_of_held_out_motions(corpus, split):
    drawer = Drawer(corpus, split, split.test, receptive=8)
    draw, again, other = drawer.draw(0, 12), drawer.draw(0, 12), drawer.draw(1, 12)
    own = corpus.style_ids[draw.contents]
    assert (draw.targets != own).all()
    assert set(draw.targets) <= set(split.scored)
    assert set(draw.references) <= set(split.references)
    np.testing.assert_array_equal(corpus.style_ids[draw.references], draw.targets)
    there = draw.cells >= 0
    np.testing.assert_array_equal(corpus.style_ids[draw.cells[there]], draw.targets[there])
    np.testing.assert_array_equal(corpus.action_ids[draw.cells[there]], draw.actions[there])
    assert not set(draw.contents) & set(draw.others)
    np.testing.assert_array_equal(draw.references, again.references)
    assert not set(draw.seeds) & set(other.seeds)
    rest = np.setdiff1d(np.flatnonzero(corpus.clips.split == "test"), split.test)
    unseen = Drawer(corpus, split, rest, 8, unseen=True).draw(0, 12)
    pairs = set(zip(unseen.targets.tolist(), unseen.actions.tolist(), strict=True))
    assert pairs
    assert pairs <= set(split.cells)
    with pytest.raises(InputError, match="1000 frames"):
        Drawer(corpus, split, split.test, receptive=1000)


def test_rotations_leave_the_path_out_and_measure_turned_joints(pipeline):
    corpus = Corpus.open(pipeline / "data/corpus")
    features = [np.array(corpus.features(i)) for i in range(3)]
    walked = [f.copy() for f in features]
    for f in walked:
        f[:, :3] += 0.1
    same = local_rotations(features, corpus.context, 4)
    assert len(same) == sum(len(f[::4]) for f in features)
    np.testing.assert_allclose(turned(same, local_rotations(walked, corpus.context, 4)), 0, atol=1e-5)
    others = [np.resize(features[i - 1], f.shape) for i, f in enumerate(features)]
    assert turned(same, local_rotations(others, corpus.context, 4)).mean() > 0.02


def test_closed_forms_of_angle_and_spread():
    half = np.sqrt(0.5)
    a, b = np.array([[[0, 0, 0, 1.0], [0, 0, 0, 1]]]), np.array([[[half, 0, 0, half], [0, 0, 0, 1]]])
    np.testing.assert_allclose(turned(a, b), [np.pi / 4])  # a right angle at one of two joints
    x = np.array([[[0.0, 0], [3, 4], [3, 4]]])
    assert spread(x) == pytest.approx(10 / 3)
    assert spread(np.ones((5, 4, 3))) == 0


def test_pictures_of_codes_and_styles(corpus, split, context):
    figure = draw_codes(Copier(), corpus, split, BOTH, 40)
    assert len(figure.axes) == 2
    assert sum(len(c.get_offsets()) for c in figure.axes[0].collections) == 40
    motions, captions = many_styles(Perfect(corpus), corpus, split, BOTH)
    assert captions[1:] == [split.styles[s] for s in split.scored]
    assert captions[0].startswith("the motion itself")
    assert len({m.frames for m in motions}) == 1
    bare = styled_corpus(context, labels=False, bare=16)
    assert draw_codes(Copier(), bare, style_split(bare), BOTH, 40) is None
    assert len(many_styles(Copier(), bare, style_split(bare), ("unsupervised",))[0]) == 6


def test_bad_settings_are_named():
    for key, value in (("repetitions", 0), ("contents", 1), ("diversity_samples", 1)):
        with pytest.raises(InputError, match=f"style_evaluation.{key}"):
            StyleProtocol(**{key: value})


def test_a_trained_judge_serves(corpus, split):
    """The real judge has what the protocol asks for."""
    from motionary.systems.judges.style_evaluator import StyleEvaluator, StyleEvaluatorConfig

    judge = StyleJudge(StyleEvaluator(StyleEvaluatorConfig(width=8, dim=4), corpus.context))
    rows = score(Copier(), corpus, split, ("unsupervised",), judge, StyleProtocol(repetitions=1, contents=6))
    assert "style_fid" in rows[HELD_OUT]["motion-based (U)"]


def test_a_corpus_whose_styles_are_too_rare_is_measured_all_the_same(corpus):
    """Nothing is held out; contents come from the test split, and what needs a scored style is left out."""
    split = style_split(corpus, 0.3, scored_clips=1000)
    rows = score(Copier(), corpus, split)[TEST]
    assert not any("(S)" in row for row in rows)
    assert set(rows[REAL]) >= {"content_accuracy", "content_fid", "foot_skating"}
    assert "style_accuracy" not in rows["motion-based (U)"]
    assert mean(rows, "motion-based (U)", "content_accuracy") == 1
    assert any(COPIED_ROOT in row for row in rows)
    assert draw_codes(Copier(), corpus, split, BOTH, 40) is None
    assert many_styles(Perfect(corpus), corpus, split, BOTH)[1][1:] == list(split.styles)
    assert len(many_styles(Perfect(corpus), corpus, split, ("unsupervised",))[0]) == 6


def test_the_real_stylizer_is_scored_on_the_demo_corpus(pipeline, tmp_path):
    """Untrained models, whose answers are wrong but have every shape and interface."""
    from motionary.systems.io import open_system
    from motionary.systems.judges.style_evaluator import StyleEvaluator, StyleEvaluatorConfig

    add_stylizers(pipeline, tmp_path)
    corpus, stylizer = Corpus.open(pipeline / "data/corpus"), open_system("stylization", "stylize", tmp_path)
    split = style_split(corpus)
    judge = StyleJudge(StyleEvaluator(StyleEvaluatorConfig(width=8, dim=4), corpus.context))
    settings = list(stylizer.stylizers)
    found = score_stylization(stylizer, judge, corpus, split, StyleProtocol(2, 4, 2, 2), settings)
    assert {"motion-based (U)", "prior-based (U)"} < set(found[TEST]["rows"])
    motions, _ = many_styles(stylizer, corpus, split, settings)
    assert len(motions) == 1 + min(8, len(corpus.context.styles))
