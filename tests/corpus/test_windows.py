"""Windows stay inside their bounds; a caption goes with one window of what it is said of, the rest has none."""

from dataclasses import replace

import numpy as np
import pytest

from motionary.corpus.clips import Caption, Clip
from motionary.corpus.windows import LONG, SHORT, Rule, windows

RULE = Rule(fps=20.0, min_seconds=2.0, max_seconds=10.0, unit=4)


def clip(*spans):
    return Clip("x", None, "x", "x", captions=tuple(Caption(f"text {i}", *span) for i, span in enumerate(spans)))


@pytest.mark.parametrize(
    ("seconds", "lengths"),
    [(1.9, []), (2.0, [36]), (2.05, [40]), (9.95, [196]), (10.0, [196]), (10.2, [100, 100]), (25.0, [164, 164, 164])],
)
def test_a_clip_without_captions_is_cut_whole(seconds, lengths):
    found, dropped = windows(clip(), round(seconds * 20), RULE)
    assert [window.length for window in found] == lengths
    assert dropped == ({} if lengths else {SHORT: 1})
    assert not any(window.rest for window in found)


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
    found, dropped = windows(clip((0, 4), (0, 4.05), (0.5, 4), (0, 1)), 100, RULE)
    texts = [[caption.text for caption in window.captions] for window in found]
    assert texts == [["text 0", "text 1"], ["text 2"]]
    assert dropped == {SHORT: 1}


@pytest.mark.parametrize("span", [(None, None), (1.0, 24.0)])
def test_a_caption_of_a_long_segment_goes_with_one_window_of_it(span):
    """And with no other: what is said of 23 or 30 seconds is not said of each third of them."""
    start, end = (span[0] or 0.0), (span[1] or 30.0)
    firsts = set()
    for seed in range(20):
        found, dropped = windows(clip(span), 600, replace(RULE, seed=seed))
        kept = [window for window in found if window.captions]
        assert len(kept) == 1
        assert kept[0].cropped
        assert kept[0].length == 196
        assert start <= kept[0].start <= kept[0].end <= end
        firsts.add(kept[0].first)
        assert found == windows(clip(span), 600, replace(RULE, seed=seed))[0]
        assert not dropped
    assert len(firsts) > 10


def test_the_rest_of_a_captioned_clip_has_no_caption_and_is_shown_once():
    rng = np.random.default_rng(1)
    for _ in range(200):
        frames = int(rng.integers(60, 1500))
        spans = np.sort(rng.uniform(0, frames / 20, (rng.integers(1, 4), 2)), axis=1)
        found, _ = windows(clip(*spans.tolist()), frames, RULE)
        shown = np.zeros(frames, int)
        for window in found:
            assert window.rest == (not window.captions)
            if window.rest:
                shown[window.first : window.first + window.length] += 1
        captioned = np.zeros(frames, int)
        for window in found:
            captioned[window.first : window.first + window.length] += bool(window.captions)
        assert shown.max() <= 1
        assert not (shown & (captioned > 0)).any()
        # What nobody sees are gaps below the shortest window, and the remainders of units.
        gaps = "".join("x" if seen else "-" for seen in (shown + captioned) > 0).split("x")
        assert max(len(gap) for gap in gaps) <= 45


def test_a_window_that_shows_too_little_of_a_segment_keeps_none_of_its_captions():
    strict = replace(RULE, least_cover=0.5)
    found, dropped = windows(clip((0, 21), (3, 9)), 420, strict)
    assert [window.captions[0].text for window in found if window.captions] == ["text 1"]
    assert dropped == {LONG: 1}
    assert len([window for window in windows(clip((0, 19.9)), 420, strict)[0] if window.captions]) == 1


def test_a_clip_of_many_sentences_keeps_each_with_its_own_stretch():
    found, dropped = windows(clip((0, 3), (3, 8), (8, 20)), 400, RULE)
    spans = [(window.start, round(window.end)) for window in found[:2]]
    assert spans == [(0.0, 3), (3.0, 8)]
    assert 8 <= found[2].start <= 10
    assert [window.captions[0].text for window in found if window.captions] == ["text 0", "text 1", "text 2"]
    assert not dropped
