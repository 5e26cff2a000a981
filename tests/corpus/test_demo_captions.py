"""Captions of the demo corpus: several, distinct, in a small vocabulary, and telling the whole truth."""

import json

import numpy as np
import pytest

from motionary.corpus.demo import demo_clip
from motionary.corpus.demo.grammar import ACTIONS, draw
from motionary.corpus.demo.sentences import COUNTS, NUMBERS, SPEEDS, captions, names_action
from motionary.corpus.demo.styles import STYLES


@pytest.fixture(scope="module")
def specs():
    """600 specs with their captions; no motion is needed for these."""
    result = []
    for index in range(600):
        rng = np.random.default_rng([1, index])
        spec = draw(rng)
        result.append((spec, captions(spec.acts, spec.style, spec.together, rng)))
    return result


def test_three_or_four_distinct_captions(specs):
    for _, texts in specs:
        assert 3 <= len(texts) <= 4
        assert len(set(texts)) == len(texts)
        for text in texts:
            assert text == " ".join(text.split())
            assert text.isascii()
            assert "{" not in text
            assert 3 <= len(text.split()) <= 20


def test_captions_tell_side_direction_count_speed_and_style(specs):
    for spec, texts in specs:
        for text in texts:
            words = text.replace(",", "").split()
            for act in spec.acts:
                if act.side:
                    assert act.side in words, (act, text)
                if act.direction in ("left", "right"):
                    assert act.direction in words, (act, text)
                elif act.direction in ("backward", "up", "forward") and act.action != "point":
                    assert any(word.startswith(act.direction) for word in words), (act, text)
                if act.count:
                    said = (*COUNTS.get(act.count, ()), NUMBERS[act.count])
                    assert any(phrase in text for phrase in said), (act, text)
                if act.speed:
                    assert any(word in words for word in SPEEDS[act.speed]), (act, text)
            if spec.style != "neutral":
                assert any(word.startswith(spec.style[:4]) for word in words), (spec.style, text)
            else:
                assert not any(style in text for style in STYLES), text


def test_captions_name_their_actions_after_lemmatizing(specs):
    from motionary.language import annotate

    pairs = [(spec, text) for spec, texts in specs[:200] for text in texts[:1]]
    for (spec, text), sentence in zip(pairs, annotate([text for _, text in pairs]), strict=True):
        for act in spec.acts:
            assert names_action(sentence.words, act.action), (act.action, text, sentence.words)


def test_vocabulary_stays_small(specs):
    words = {word for _, texts in specs for text in texts for word in text.replace(",", "").split()}
    assert len(words) < 150


def test_every_action_and_style_turns_up_and_specs_are_many(specs):
    assert {act.action for spec, _ in specs for act in spec.acts} == set(ACTIONS)
    assert {spec.style for spec, _ in specs} == set(STYLES)
    kinds = [str(spec) for spec, _ in specs]
    counts = np.unique(kinds, return_counts=True)[1]
    # A pool of 32 should hardly ever hold the same spec more than three times.
    assert np.sum(counts * (counts - 1.0)) / (len(kinds) * (len(kinds) - 1.0)) * 31 < 0.1
    assert len(counts) > 300


def test_left_and_right_are_balanced(specs):
    text = " ".join(text for _, texts in specs for text in texts).split()
    assert 0.75 < text.count("left") / text.count("right") < 1.33


def test_truth_is_plain_data():
    for index in range(20):
        _, truth = demo_clip(index, seed=1)
        assert set(truth) == {"id", "captions", "style", "action", "attributes"}
        assert truth["id"] == f"demo_{index:06d}"
        assert truth["action"] in ACTIONS
        assert truth["style"] in STYLES
        assert truth["attributes"]["acts"][0]["action"] == truth["action"]
        assert json.loads(json.dumps(truth)) == truth
