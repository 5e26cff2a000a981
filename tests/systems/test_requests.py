"""What every text-to-motion system makes of odd texts and lengths: the same rules, whatever the system."""

from __future__ import annotations

import numpy as np
import pytest

import motionary
from motionary.errors import InputError
from motionary.language import annotate
from motionary.systems.io import open_system
from motionary.systems.registry import TEXT_TO_MOTION, offering

SYSTEMS = ("text2token", "inverse_alignment", "text2motion", "retrieval")
STRANGE = "zxqv blorpt wuggle"  # letters that are near no word of the corpus


@pytest.fixture(scope="module", params=SYSTEMS)
def opened(request, pipeline):
    return open_system(request.param, TEXT_TO_MOTION, pipeline / "models", "cpu")


@pytest.fixture(scope="module")
def d(pipeline):
    return motionary.load(pipeline / "models", device="cpu")


def test_the_list_is_complete(pipeline):
    assert set(offering(TEXT_TO_MOTION, (p.name for p in (pipeline / "models").iterdir()))) == set(SYSTEMS)


@pytest.mark.parametrize("text", [STRANGE, "", " ".join(["a person walks and waves"] * 40)])
def test_unknown_words_no_words_and_many_words_still_give_a_motion(opened, text):
    sentences = annotate([text or "walk", "a person walks"])
    if not text:  # what a corpus file may hold; users get an error, see below
        sentences[0] = type(sentences[0])("", (), ())
    assert len(sentences[0].words) == {0: 0, len(STRANGE): 3}.get(len(text), 200)
    for motion in opened.generate(sentences, [0, 1]):
        assert len(motion) >= 4
        assert np.isfinite(motion).all()


def test_of_a_long_text_the_first_words_count(opened):
    many = " ".join(["a person walks and waves"] * 40)
    first, cut = (opened.generate(annotate([text]), [3])[0] for text in (many, " ".join(many.split()[:20])))
    assert np.array_equal(first, cut)


@pytest.mark.parametrize("frames", [0, 1, 3, -4, 197, 10_000, 20.5])
def test_a_length_that_no_model_makes_is_an_error_that_names_the_range(opened, frames):
    sentences = annotate(["a person walks", "jump"])
    with pytest.raises(InputError, match=rf"frames: {frames}: must be a whole number from 4 to 196"):
        opened.generate(sentences, [0, 1], [40, frames])


def test_the_shortest_and_the_longest_length_are_held(opened):
    lengths = [len(motion) for motion in opened.generate(annotate(["walk", "jump"]), [0, 1], [4, 196])]
    assert lengths[0] == 4
    assert lengths[1] == 196 or not getattr(opened, "takes_lengths", False)


def test_there_is_one_seed_and_one_length_for_each_text(opened):
    sentences = annotate(["walk", "jump"])
    with pytest.raises(InputError, match="seeds: 1: must be one per sentence, 2"):
        opened.generate(sentences, [0])
    with pytest.raises(InputError, match="frames: 1: must be one per sentence, 2"):
        opened.generate(sentences, [0, 1], [40])
    assert opened.generate([], []) == []


@pytest.mark.parametrize("system", SYSTEMS)
def test_users_are_told_the_same_by_every_system(d, system):
    for text, rule in (("", "must not be empty"), ("...", "must contain a word"), ("w" * 1001, "1000 characters")):
        with pytest.raises(InputError, match=rule):
            d.generate(text, system=system)
    for seconds in (0, 0.1, 10.5, -1):
        with pytest.raises(InputError, match=rf"seconds: {seconds}: must be a number from 0\.2 to 10"):
            d.generate("walk", seconds=seconds, system=system)
    assert d.generate(STRANGE, system=system)
