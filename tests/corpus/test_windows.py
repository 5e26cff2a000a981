"""Windows stay inside their segment, inside their bounds, and keep their captions."""

import itertools

import numpy as np
import pytest

from motionary.corpus.clips import Caption, Clip
from motionary.corpus.windows import Rule, windows

RULE = Rule(fps=20.0, min_seconds=2.0, max_seconds=10.0, unit=4)


def clip(*spans):
    return Clip("x", None, "x", "x", captions=tuple(Caption(f"text {i}", *span) for i, span in enumerate(spans)))


@pytest.mark.parametrize(
    ("seconds", "lengths"),
    [(1.9, []), (2.0, [36]), (2.05, [40]), (9.95, [196]), (10.0, [196]), (10.2, [100, 100]), (25.0, [164, 164, 164])],
)
def test_a_clip_without_captions_is_cut_whole(seconds, lengths):
    found, short = windows(clip(), round(seconds * 20), RULE)
    assert [window.length for window in found] == lengths
    assert short == (not lengths)


def test_bounds_hold_for_any_clip():
    rng = np.random.default_rng(0)
    for _ in range(500):
        rule = Rule(float(rng.choice([12.5, 20, 30])), 2.0, 10.0, 4)
        frames = int(rng.integers(2, 1500))
        spans = np.sort(rng.uniform(0, frames / rule.fps, (rng.integers(0, 4), 2)), axis=1)
        found, _ = windows(clip(*spans.tolist()), frames, rule)
        for window in found:
            assert window.length % rule.unit == 0
            assert rule.unit <= window.length <= rule.max_frames
            assert window.first >= 0
            assert window.first + window.length + 1 <= frames
            for caption in window.captions:
                assert caption.start - 1 / rule.fps <= window.first / rule.fps
                assert (window.first + window.length) / rule.fps <= caption.end + 1 / rule.fps


def test_the_longest_window_is_the_released_196_frames():
    assert RULE.max_frames == 196
    assert Rule(12.5, 2.0, 10.0, 4).max_frames == 124


def test_each_distinct_segment_is_a_window_and_near_equal_ones_are_one():
    found, short = windows(clip((0, 4), (0, 4.05), (0.5, 4), (0, 1)), 100, RULE)
    texts = [[caption.text for caption in window.captions] for window in found]
    assert texts == [["text 0", "text 1"], ["text 2"]]
    assert short == 1


def test_long_segments_become_equal_pieces_with_their_captions():
    found, _ = windows(clip((1.0, 24.0)), 600, RULE)
    assert len(found) == 3
    assert {window.length for window in found} == {152}
    assert all(window.captions[0].text == "text 0" for window in found)
    assert found[0].start == 1.0
    assert all(a.end <= b.start for a, b in itertools.pairwise(found))


def test_without_captions_left_the_whole_clip_is_used():
    found, _ = windows(clip(), 200, RULE)
    assert [window.captions for window in found] == [()]
