"""Spans that are made in view of what stands around them: what is shown, what is known, and what comes back."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.corpus.demo import demo_clip
from motionary.corpus.store import Corpus
from motionary.dictionary import load
from motionary.dictionary.infilling import infilled
from motionary.motion import Motion, retarget


class Echo:
    """Tokens are the frames themselves; what is unknown becomes the first token again."""

    def __init__(self, context):
        self.context, self.known = context, np.zeros(0, bool)

    def encode(self, features):
        unit = self.context.unit
        return [f[: len(f) // unit * unit].reshape(-1, unit, f.shape[1]) for f in features]

    def infill(self, tokens, known, sentences, seeds, **options):
        self.known, self.asked = known[0], (sentences, seeds)
        return [np.where(known[0][:, None, None], tokens[0], tokens[0][:1])]

    def decode(self, tokens):
        return [t.reshape(-1, t.shape[2]) for t in tokens]


@pytest.fixture(scope="module")
def context(pipeline):
    return Corpus.open(pipeline / "data/corpus").context


@pytest.fixture(scope="module")
def walk(context) -> Motion:
    return retarget(demo_clip(3)[0], context.skeleton)


@pytest.mark.parametrize("span", [(20, 40), (21, 40), (0, 16), (60, 95), (10, 11), (0, 90)])
def test_what_lies_outside_is_known_and_as_many_frames_come_back(context, walk, span):
    echo = Echo(context)
    made = infilled(echo, walk, span, None, 7)
    assert made.frames == span[1] - span[0]
    assert echo.asked == ([None], [7])
    unknown = np.flatnonzero(~echo.known)
    assert len(unknown) == unknown[-1] - unknown[0] + 1  # one span
    assert len(unknown) * context.unit < made.frames + 2 * context.unit
    assert len(echo.known) <= context.max_tokens
    assert echo.known.any()


@pytest.mark.parametrize(("frames", "span"), [(42, (1, 41)), (43, (2, 40)), (9, (1, 8))])
def test_a_single_pose_on_each_side_is_seen(context, walk, frames, span):
    """Held for a token: the first and the last token are known, and show the pose."""
    echo = Echo(context)
    made = infilled(echo, walk.crop(0, frames), span, None, 7)
    assert made.frames == span[1] - span[0]
    assert echo.known[[0, -1]].tolist() == [True, True]
    assert (~echo.known).sum() * context.unit < made.frames + context.unit


def test_what_one_side_does_not_need_the_other_shows(context, walk):
    """A span near the end leaves all the room that is left to what comes before it."""
    long = Motion(np.tile(walk.positions, (4, 1, 1))[: 2 * context.max_frames], walk.fps, walk.skeleton)
    echo = Echo(context)
    infilled(echo, long, (long.frames - 30, long.frames - 6), None, 7)
    assert len(echo.known) == context.max_tokens
    assert echo.known.sum() * context.unit >= context.max_frames - 24 - 2 * context.unit


def test_a_span_as_long_as_systems_learn_needs_a_sentence(context, walk, pipeline):
    long = Motion(np.tile(walk.positions, (4, 1, 1))[: context.max_frames + 20], walk.fps, walk.skeleton)
    echo, span = Echo(context), (20, context.max_frames + 20)
    assert infilled(echo, long, span, None, 7) is None
    sentence = load(pipeline / "models", "cpu")._sentences("a person walks")[0]
    assert infilled(echo, long, span, sentence, 7).frames == context.max_frames
