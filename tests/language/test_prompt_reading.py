"""Words that captions do not have: read by their meaning, and said."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.language import Meanings, Vocabulary, annotate, packaged_model, read, sentence_embeddings
from motionary.language.frozen import _LONGEST, _transformer
from motionary.language.minilm import minilm
from motionary.language.text import with_words

CAPTIONS = [
    "a person walks forward and stops", "a person sprints across the room", "somebody throws a ball",
    "a person jumps over a chair", "a person walks quickly", "a person sits on a chair", "a person throws a ball",
    "somebody sprints and jumps", "a person waves with the left hand",
]  # fmt: skip


@pytest.fixture(scope="module")
def vocabulary() -> Vocabulary:
    return Vocabulary.build(annotate(CAPTIONS))


@pytest.fixture(scope="module")
def meanings(vocabulary) -> Meanings:
    return Meanings.of(vocabulary, annotate(CAPTIONS))


def reading(text: str, vocabulary, meanings):
    (sentence,) = annotate([text])
    return read(sentence, vocabulary, lambda: meanings)


def test_a_known_text_is_read_as_it_stands_and_opens_no_meanings(vocabulary):
    (sentence,) = annotate(["A person walks forward."])
    found = read(sentence, vocabulary, lambda: pytest.fail("opened"))
    assert (found.words, found.replaced, found.unknown, found.line) == ("a person walk forward", {}, (), "")


@pytest.mark.parametrize("text", ["he walks", "She walks.", "the man walks", "someone is walking", "a guy walks"])
def test_common_words_are_known_in_any_corpus(text, vocabulary, meanings):
    found = reading(text, vocabulary, meanings)
    assert found.words.split()[-1] == "walk"
    assert "<unknown>" not in found.words
    assert {"person", "somebody"} & set(found.words.split())
    assert found.line == ""


def test_an_unknown_word_is_read_as_the_nearest_of_its_kind(vocabulary, meanings):
    found = reading("a man hurls a stool", vocabulary, meanings)
    assert found.replaced["stool"] == "chair"
    assert "stool (nearest: chair)" in found.line
    assert reading("a person dashes", vocabulary, meanings).replaced == {"dash": "sprint"}
    assert reading("a persn walks", vocabulary, meanings).replaced == {"persn": "person"}


@pytest.mark.parametrize(
    ("text", "read_as"),
    [("a person hurls a ball", "a person throw a ball"), ("he sits on the sofa", "person sit on the chair")],
)
def test_a_synonym_stands_before_what_a_sentence_model_thinks_near(text, read_as, vocabulary, meanings):
    found = reading(text, vocabulary, meanings)
    assert found.words == read_as
    assert found.replaced
    assert "not known: " in found.line


def test_what_is_not_to_happen_is_never_read_as_something_else(vocabulary, meanings):
    vocabulary = Vocabulary.build(annotate([*CAPTIONS, "did you ever walk", "you ever jump"]))
    found = reading("a person never sits", vocabulary, Meanings.of_words(vocabulary))
    assert found.words == "a person <unknown> sit"
    for text, word in [
        ("a person never sits", "never"),
        ("she doesn't jump", "not"),
        ("walks without a chair", "without"),
    ]:
        assert f"systems hardly know {word}" in reading(text, vocabulary, meanings).line
    assert "systems hardly know" not in reading("a person notably walks", vocabulary, meanings).line


def test_a_foreign_prompt_is_told_the_language(vocabulary, meanings):
    assert "prompts are read in English" in reading("ein xqzter geht im kreis", vocabulary, meanings).line
    assert "in English" not in reading("a person xqzts", vocabulary, meanings).line


@pytest.mark.parametrize("text", ["ein mann springt", "una persona camina", "der walks", "une person jumps quickly"])
def test_words_near_english_ones_do_not_make_a_prompt_english(text, vocabulary, meanings):
    assert "prompts are read in English" in reading(text, vocabulary, meanings).line


@pytest.mark.parametrize("text", ["a persn walks quikly", "he hurls a stool", "a person dashes to the sofa"])
def test_english_with_unknown_words_and_typos_is_not_told_the_language(text, vocabulary, meanings):
    found = reading(text, vocabulary, meanings)
    assert found.line
    assert "in English" not in found.line


def test_what_has_no_meaning_is_said_and_not_made_up(vocabulary, meanings):
    found = reading("a person xqzts", vocabulary, meanings)
    assert found.unknown
    assert found.words.endswith("<unknown>")
    assert "without any meaning here" in found.line
    nothing = reading("blorf", vocabulary, meanings)
    assert (nothing.words, nothing.unknown) == ("<unknown>", ("blorf",))


def test_distance_is_to_the_nearest_caption(vocabulary, meanings):
    same = reading(CAPTIONS[3], vocabulary, meanings).measured(meanings)
    assert same.nearest == CAPTIONS[3]
    assert same.distance == pytest.approx(0, abs=1e-5)
    text = "the stock market crashes"
    far = reading(text, vocabulary, meanings).measured(meanings)
    likeness = sentence_embeddings(CAPTIONS) @ sentence_embeddings([text])[0]
    assert far.distance == pytest.approx(1 - likeness.max(), abs=1e-5)
    assert "far from anything known" in far.line
    assert reading(text, vocabulary, meanings).measured(Meanings.of_words(vocabulary)).distance is None


def test_typos_and_synonyms_are_as_near_as_what_they_are_read_as(vocabulary, meanings):
    said = reading("a person sits on a sofa", vocabulary, meanings)
    assert said.compared == "a person sits on a chair"
    assert (said.measured(meanings).nearest, said.guessed) == ("a person sits on a chair", ())
    assert said.measured(meanings).distance == pytest.approx(0, abs=1e-5)
    assert reading("a persn waves with the left hand", vocabulary, meanings).measured(meanings).distance < 1e-5


def test_guesses_are_as_far_as_they_were_typed(vocabulary, meanings):
    text = "a person throws a balloon"
    said = reading(text, vocabulary, meanings)
    assert said.guessed == tuple(said.replaced) == ("balloon",)
    assert said.compared == text
    known = reading("a person throws a ball", vocabulary, meanings).measured(meanings)
    assert said.measured(meanings).distance > known.distance + 0.1


def test_meanings_survive_the_disk(meanings, tmp_path):
    meanings.save(tmp_path)
    again = Meanings.load(tmp_path)
    assert (again.words, again.tags, again.captions) == (meanings.words, meanings.tags, meanings.captions)
    assert np.abs(again.vectors - meanings.vectors).max() < 2e-3
    assert again.nearest("stool", "OBJECT") == "chair"


def test_a_typo_of_the_captions_stands_for_nothing(meanings):
    assert "wave" not in meanings.words  # once only
    assert "with" not in meanings.words
    assert {"person", "walk", "chair"} <= set(meanings.words)


def test_a_misspelled_word_of_captions_is_not_what_another_is_read_as():
    texts = ["a person is straifht and walks", "a person is straifht again", "a person walks upright"]
    vocabulary = Vocabulary.build(annotate(texts))
    meanings = Meanings.of(vocabulary, annotate(texts))
    assert "straifht" in meanings.words
    tag = meanings.tags[meanings.words.index("straifht")]
    assert meanings.nearest("straight", tag) != "straifht"


def test_the_packaged_model_computes_what_transformers_computes():
    texts = ["a person walks in a circle", "hi", "one two three " * 120]
    theirs, mask = _transformer(str(packaged_model()), "cpu")(texts)
    ours, kept = minilm(packaged_model(), _LONGEST)(texts)
    assert bool((mask == kept).all())
    assert float(((ours - theirs) * mask[..., None]).abs().max()) < 1e-4


@pytest.mark.parametrize(
    ("text", "words", "expected"),
    [
        ("he wolks and wolks", {"wolk": "walk"}, "he walks and walks"),
        ("Strolled, then trotted", {"stroll": "walk", "trot": "run"}, "walked, then runted"),  # endings stay
        ("a hop and a skip", {"hop": "skip", "skip": "hop"}, "a skip and a hop"),  # none is replaced again
        ("the sofabed", {"sofa": "chair", "sofabed": "bed"}, "the bed"),
        ("as it is", {}, "as it is"),
    ],
)
def test_words_are_replaced_once_wherever_they_stand(text, words, expected):
    assert with_words(text, words) == expected
