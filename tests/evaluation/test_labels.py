"""Captions by label on a corpus of a few rows, counted by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from motionary.evaluation.labels import captions_by_labels, score_by_labels
from motionary.language import annotate
from motionary.metrics.captions import bleu

ROWS = [  # split, style, action, captions
    ("train", "old", "walk", ["an old person walks forward slowly", "an old person takes a walk"]),
    ("train", "old", "walk", ["an old person takes a walk"]),
    ("train", "young", "walk", ["a young person walks forward", "a young person walks forward again", "hop", "hop"]),
    ("train", "", "walk", ["a person walks around in a circle"]),
    ("test", "old", "walk", ["an old person walks forward slowly"]),
    ("test", "young", "walk", ["a young person walks forward"]),
    ("test", "old", "run", ["an old person runs forward"]),
    ("test", "young", "run", ["a young person runs forward"]),
    ("test", "", "walk", ["a person walks around in a circle"]),
]


@pytest.fixture
def items():
    split, style, action = (np.array(column) for column in list(zip(*ROWS, strict=True))[:3])
    sentences = [annotate(captions) for *_, captions in ROWS]
    starts = np.cumsum([0, *(len(several) for several in sentences)])
    words = np.empty(starts[-1], dtype=object)
    words[:] = [sentence.words for several in sentences for sentence in several]
    corpus = SimpleNamespace(
        clips=SimpleNamespace(style=style, action=action),
        captions=SimpleNamespace(words=words),
        rows=lambda name, captioned: np.flatnonzero(split == name),
        captions_of=lambda row: range(starts[row], starts[row + 1]),
    )
    rows = np.flatnonzero(split == "test")
    return SimpleNamespace(corpus=corpus, rows=rows, references=[sentences[row] for row in rows])


def test_training_captions_are_counted_by_style_and_action(items):
    known = captions_by_labels(items.corpus)
    assert known["old", "walk"] == {"an old person take a walk": 2, "an old person walk forward slowly": 1}
    assert ("old", "run") not in known


def test_known_combinations_stand_apart_and_beside_the_reader(items):
    truths = [" ".join(several[0].words) for several in items.references]
    captions = [truths[0], "a man jump", truths[2], truths[3], "anything"]
    found = score_by_labels(captions, [[truth] for truth in truths], items, captions_by_labels(items.corpus))
    assert (found["seen"]["items"], found["unseen"]["items"]) == (2, 2)  # without labels: in neither
    assert found["seen"]["said"] == 0.5
    assert found["unseen"]["bleu4"]["mean"] == pytest.approx(1.0)
    reader = ["an old person take a walk", "a young person walk forward"]
    assert found["seen"]["reader"]["mean"] == pytest.approx(bleu(reader, [[t] for t in truths[:2]])[3], abs=1e-5)
    assert found["seen"]["bleu4"]["mean"] == pytest.approx(bleu(captions[:2], [[t] for t in truths[:2]])[3], abs=1e-5)
    assert set(found["unseen"]) == {"items", "bleu4"}


def test_a_corpus_without_labels_has_nothing_to_say(items):
    items.corpus.clips.style[:] = ""
    said = ["a person walk"] * 5
    assert score_by_labels(said, [[text] for text in said], items, captions_by_labels(items.corpus)) == {}
