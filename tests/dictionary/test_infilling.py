"""Spans that are made in view of what stands around them: what is shown, what is known, and what comes back."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.corpus.demo import demo_clip
from motionary.corpus.store import Corpus
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
