"""Normalized words and their classes, on known sentences and on all real captions."""

import json
import subprocess
import sys
from threading import Thread

import pytest

from motionary.errors import InputError
from motionary.language import TAGS, Sentence, annotate, check_prompt, sentence_from_tokens
from motionary.language.lexicon import inflections, lexicon


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("A person waves.", "a person wave"),
        ("A man is waving his left arm!", "a man is wave his left arm"),
        ("she waves and jumps", "she wave and jump"),
        ("the person took three steps backwards", "the person take three step backward"),
        ("he left the room", "he left the room"),
        ("people were running on their hands and feet", "person is run on their hand and foot"),
        ("Someone hops 4 times", "someone hop four times"),
        ("turns counter-clockwise; then anticlockwise", "turn counterclockwise then counterclockwise"),
        ("rotates his torso clockwise", "rotate his torso clockwise"),
        ("a t-pose as if to a pose", "a tpose as if to a pose"),
        ("they don't stop, it's still", "they do not stop it is still"),
        ("a person's knees bent", "a person knee bend"),
        ("run/jog, sudden stop", "run jog sudden stop"),
        ("KickFlipStumble", "kick flip stumble"),
        ("a jeté, 90-degree turns", "a jete 90 degree turn"),
        ("lying down after he fell", "lie down after he fall"),
        ("  double   blanks\tand\nlines ", "double blank and line"),
        ("", ""),
        ("?! ...", ""),
    ],
)
def test_known_sentences_become_these_words(text, words):
    # "times" is a noun of ten senses; whichever the tagger picks, its plural goes.
    assert annotate([text])[0].normalized == words.replace("times", "time")


def test_tags_come_from_the_motion_dictionary_before_the_tagger():
    (sentence,) = annotate(["a person slowly waves the left hand with two balls"])
    expected = "DET NOUN DESCRIPTION ACTION DET LOCATION BODY_PART ADP NUM OBJECT"
    assert sentence.tags == tuple(expected.split())


@pytest.mark.parametrize(
    ("text", "word", "tag"),
    [
        ("he walks back", "back", "LOCATION"),
        ("he rubs his back", "back", "BODY_PART"),
        ("a slow walk", "slow", "DESCRIPTION"),
        ("he turns his face", "face", "BODY_PART"),
        ("a person walks in a circle", "circle", "LOCATION"),
        ("they do it and stop", "and", "OTHER"),
        ("the man is calm", "is", "AUX"),
        ("the thug stumbles", "thug", "NOUN"),
    ],
)
def test_words_of_several_classes(text, word, tag):
    (sentence,) = annotate([text])
    assert sentence.tags[sentence.words.index(word)] == tag


def test_fifteen_classes_in_the_released_order():
    assert len(TAGS) == 15
    assert TAGS[:9] == ("VERB", "NOUN", "DET", "ADP", "NUM", "AUX", "PRON", "ADJ", "ADV")
    assert TAGS[9:] == ("LOCATION", "BODY_PART", "OBJECT", "ACTION", "DESCRIPTION", "OTHER")


@pytest.mark.parametrize(
    ("lemma", "forms"),
    [
        ("hop", "hops hopped hopping"),
        ("squat", "squats squatted squatting"),
        ("wave", "waves waved waving"),
        ("box", "boxes boxed boxing"),
        ("carry", "carries carried carrying"),
        ("sway", "sways swayed swaying"),
        ("tie", "ties tied tying"),
        ("lean", "leans leaned leaning"),
        ("flee", "flees fleed fleeing"),
    ],
)
def test_inflections(lemma, forms):
    assert inflections(lemma) == tuple(forms.split())


def test_dictionary_words_are_their_own_lemmas():
    table = lexicon()
    wrong = [word for word in table.members if table.lemma(word, "NOUN", "other") != word]
    assert wrong == []
    assert [lemma for lemma in table.overrides.values() if table.lemma(lemma) != lemma] == []


def test_order_repetition_and_threads_do_not_matter():
    texts = [f"a person jumps {count} times and turns" for count in range(2, 9)]
    results = {}

    def work(key, chosen):
        results[key] = annotate(chosen)

    threads = [Thread(target=work, args=(key, texts[key:] + texts[:key] * 2)) for key in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    alone = {sentence.text: sentence for sentence in annotate(texts)}
    for found in results.values():
        assert all(sentence == alone[sentence.text] for sentence in found)
    assert [sentence.text for sentence in results[2]] == texts[2:] + texts[:2] * 2


def test_released_tokens_keep_their_lemmas():
    sentence = sentence_from_tokens("a person walks left", ["a/DET", "person/NOUN", "walk/VERB", "left/ADV"])
    assert sentence == Sentence(
        "a person walks left", ("a", "person", "walk", "left"), ("DET", "NOUN", "ACTION", "LOCATION")
    )


@pytest.mark.parametrize(
    ("prompt", "rule"),
    [
        ("", "empty"),
        (" \n\t", "empty"),
        (None, "string"),
        (3, "string"),
        ("walk " * 300, "1000 characters"),
        ("二人が歩く", "English"),
        ("человек идёт", "English"),
        ("?!", "a word"),
    ],
)
def test_bad_prompts_name_their_rule(prompt, rule):
    with pytest.raises(InputError, match=rule) as caught:
        check_prompt(prompt, "captions.txt")
    assert str(caught.value).startswith("captions.txt: ")
    assert "\n" not in str(caught.value)


def test_good_prompts_lose_only_their_outer_blanks():
    assert check_prompt("  a person waves ") == "a person waves"
    assert check_prompt("a grand jeté, naïvely") == "a grand jeté, naïvely"


@pytest.mark.parametrize("texts", ["a person", [None], [b"walk"]])
def test_annotate_wants_strings(texts):
    with pytest.raises(InputError):
        annotate(texts)


def test_import_loads_neither_tagger_nor_torch():
    code = (
        "import sys, motionary.language, motionary.metrics.captions\n"
        "print([name for name in ('spacy', 'torch', 'transformers', 'spellchecker') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.fixture(scope="module")
def real_sentences(shared_data):
    texts = {}
    for name in ("captioned", "styled"):
        for line in (shared_data / name / "clips.jsonl").read_text(encoding="utf-8").splitlines():
            texts.update(dict.fromkeys(caption["text"] for caption in json.loads(line).get("captions", [])))
    return annotate(list(texts))


@pytest.mark.real
def test_real_captions_are_lemmas_without_gaps(real_sentences):
    assert len(real_sentences) > 800
    for sentence in real_sentences:
        assert sentence.words, sentence.text
        assert len(sentence.words) == len(sentence.tags)
        assert all(word == word.lower() and word.isalnum() for word in sentence.words)
        assert set(sentence.tags) <= set(TAGS)
        assert ("left" in sentence.text.lower()) == any(word.startswith("left") for word in sentence.words)
    words = {word for sentence in real_sentences for word in sentence.words}
    inflected = {
        "leave",
        "leaf",
        "waves",
        "waving",
        "jumps",
        "steps",
        "walks",
        "walking",
        "arms",
        "hands",
        "feet",
        "was",
    }
    assert words & inflected == set()


@pytest.mark.real
def test_real_verbs_and_sides_find_their_classes(real_sentences):
    tags = {}
    for sentence in real_sentences:
        for word, tag in zip(sentence.words, sentence.tags, strict=True):
            tags.setdefault(word, set()).add(tag)
    for word in ("walk", "run", "wave", "kick", "jump", "raise", "bow"):
        assert tags[word] == {"ACTION"}
    for word in ("left", "right", "forward", "backward"):
        assert tags[word] == {"LOCATION"}
    for word in ("old", "slowly", "angrily", "tired"):
        assert tags[word] == {"DESCRIPTION"}
