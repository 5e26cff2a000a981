"""Vocabulary: round trips, truncation, typos and unknown words."""

import json

import numpy as np
import pytest

from motionary.errors import InputError
from motionary.language import END, PAD, START, TAGS, UNKNOWN, Sentence, Vocabulary, annotate
from motionary.language.spelling import edit_distance

TEXTS = [
    "a person waves the right arm",
    "a person walks forward slowly",
    "a person walks backward angrily and turns around",
    "someone wades through water",
]


def sentence(*words):
    return Sentence(" ".join(words), words, ("NOUN",) * len(words))


@pytest.fixture(scope="module")
def vocabulary():
    return Vocabulary.build(annotate(TEXTS))


def test_special_words_first_then_by_frequency(vocabulary):
    assert (PAD, START, END, UNKNOWN) == (0, 1, 2, 3)
    assert vocabulary.words[4:7] == ("a", "person", "walk")
    assert list(vocabulary.counts[4:]) == sorted(vocabulary.counts[4:], reverse=True)
    assert Vocabulary.build(reversed(annotate(TEXTS))) == vocabulary


def test_rare_words_are_left_out():
    small = Vocabulary.build(annotate(TEXTS), min_count=2)
    assert set(small.words[4:]) == {"a", "person", "walk"}
    with pytest.raises(InputError, match="min_count"):
        Vocabulary.build([], min_count=0)


def test_json_round_trip(vocabulary):
    assert Vocabulary.from_json(json.loads(json.dumps(vocabulary.to_json()))) == vocabulary
    for broken in ({}, {"words": ["a"], "counts": []}, {"words": ["a", "a"], "counts": [1, 1]}):
        with pytest.raises(InputError, match="vocabulary"):
            Vocabulary.from_json(broken)


def test_encode_and_decode_return_the_words(vocabulary):
    for each in annotate(TEXTS):
        ids, tags = vocabulary.encode(each)
        assert ids.dtype == tags.dtype == np.int64
        assert (ids[0], ids[-1]) == (START, END)
        assert vocabulary.decode(ids) == vocabulary.decode([*ids, PAD, 5]) == each.normalized
        assert tuple(TAGS[tag] for tag in tags) == ("OTHER", *each.tags, "OTHER")


def test_long_sentences_keep_their_first_twenty_words(vocabulary):
    ids, tags = vocabulary.encode(sentence(*["walk"] * 30, "person"))
    assert len(ids) == len(tags) == 22
    assert vocabulary.decode(ids) == " ".join(["walk"] * 20)
    assert len(vocabulary.encode(sentence("walk", "walk"), max_words=1)[0]) == 3


def test_empty_and_unknown_sentences_encode(vocabulary):
    assert vocabulary.encode(annotate([""])[0])[0].tolist() == [START, END]
    assert vocabulary.encode(sentence("qwertz", "歩く"))[0].tolist() == [START, UNKNOWN, UNKNOWN, END]


def test_batches_are_padded(vocabulary):
    sentences = [*annotate(TEXTS), sentence()]
    ids, tags, counts = vocabulary.encode_batch(sentences)
    assert ids.shape == tags.shape == (5, counts.max())
    for row, each in enumerate(sentences):
        alone = vocabulary.encode(each)
        assert ids[row, : counts[row]].tolist() == alone[0].tolist()
        assert tags[row, : counts[row]].tolist() == alone[1].tolist()
        assert (ids[row, counts[row] :] == PAD).all()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a persn wavse", "a person wave"),
        ("wlaks forwrd", "walk forward"),
        ("slowwly truns arond", "slowly turn around"),
        ("angry walkers", "angrily walk"),
        ("slow walk", "slowly walk"),
        ("teh wave", "<unknown> wave"),  # too short to guess
        ("someone bakes", "someone <unknown>"),  # English, though one letter from a known word
        ("wade", "wade"),
        ("fade", "<unknown>"),
        ("xylqz 歩く", "<unknown> <unknown>"),
    ],
)
def test_correction(vocabulary, text, expected):
    corrected = vocabulary.correct(annotate([text])[0])
    assert corrected.normalized == expected
    assert len(corrected.tags) == len(corrected.words)
    assert corrected.text == text


def test_corrected_words_take_their_own_tags_and_known_sentences_stay(vocabulary):
    wrong = sentence("persn", "wavse", "rihgt", "slowwly")
    assert vocabulary.correct(wrong).tags == ("NOUN", "ACTION", "LOCATION", "DESCRIPTION")
    known = annotate(TEXTS)[0]
    assert vocabulary.correct(known) is known


def test_of_two_neighbors_the_more_frequent_wins():
    words = Vocabulary.build([sentence("bqarn"), sentence("bqart"), sentence("bqart")])
    assert words.correct(sentence("bqarx")).words == ("bqart",)


@pytest.mark.parametrize(
    ("a", "b", "edits"), [("", "abc", 3), ("wave", "wavse", 1), ("walk", "wlak", 1), ("kick", "wave", 4), ("a", "a", 0)]
)
def test_edit_distance(a, b, edits):
    assert edit_distance(a, b) == edit_distance(b, a) == edits
