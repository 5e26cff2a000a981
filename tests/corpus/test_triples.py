"""Triples of stylization: two different stretches of one window, and a third of any."""

from types import SimpleNamespace

import numpy as np
import pytest

from motionary.corpus.triples import Triples
from motionary.errors import InputError


def counted(lengths):
    """A corpus of windows in which every frame bears a number of its own."""
    lengths = np.array(lengths)
    clips = SimpleNamespace(length=lengths, offset=np.cumsum(lengths) - lengths)
    labels = np.full(len(lengths), -1)
    frames = np.arange(lengths.sum(), dtype=np.float32)[:, None]
    context = SimpleNamespace(unit=4)
    return SimpleNamespace(clips=clips, frames=frames, style_ids=labels, action_ids=labels, context=context)


@pytest.mark.parametrize("window", [64, 160])
def test_both_stretches_of_a_window_always_differ(window):
    """Windows of all lengths, those below and at the training window included, drawn 400 times."""
    corpus = counted([12, 16, 20, 36, 60, 64, 68, 100, 160, 164, 196])
    data, rng, rows = Triples(corpus, np.arange(11), window), np.random.default_rng(0), np.arange(11)
    apart = []
    for _ in range(400):
        batch = data.collate(rows, rng)
        first, second, third = batch.motion[:, 0, 0].numpy().astype(int).reshape(3, 11)
        frames = batch.frames.numpy().reshape(3, 11)
        apart.append(np.abs(first - second))
        for start, count in zip((first, second), frames[:2], strict=True):
            assert (start >= corpus.clips.offset).all()
            assert (start + count <= corpus.clips.offset + corpus.clips.length).all()
        np.testing.assert_array_equal(frames[0], frames[1])
        assert (frames % 4 == 0).all()
        assert frames.min() >= 8
        assert frames.max() <= window
        other = np.searchsorted(corpus.clips.offset, third, side="right") - 1
        assert (third + frames[2] <= corpus.clips.offset[other] + corpus.clips.length[other]).all()
    assert np.min(apart) > 0
    # Not by a hair: from windows of two seconds on by a tenth of a second at least, on the average by much more.
    assert (np.min(apart, axis=0)[3:] >= 3).all()
    assert (np.mean(apart, axis=0)[3:] >= corpus.clips.length[3:] * 0.1).all()


def test_every_part_of_a_window_is_drawn():
    corpus = counted([36])
    data, rng = Triples(corpus, np.arange(1), 64), np.random.default_rng(1)
    starts = np.concatenate([data.collate(np.zeros(20, int), rng).motion[:40, 0, 0].numpy() for _ in range(50)])
    assert set(starts.astype(int)) == set(range(13))


def test_windows_without_two_different_stretches_are_left_out():
    assert Triples(counted([8, 12, 40]), np.arange(3), 64).rows.tolist() == [1, 2]
    with pytest.raises(InputError, match="more than 8 frames"):
        Triples(counted([8, 4]), np.arange(2), 64)


def test_real_features_differ_between_the_stretches(corpus):
    data = Triples(corpus, corpus.rows("train"), 300, balance=0.5)
    batch = data.collate(np.arange(len(data)), np.random.default_rng(0))
    first, second, _ = batch.motion.chunk(3)
    assert ((first - second).abs().amax((1, 2)) > 1e-3).all()
