"""Captions as they were written: their words, their vocabulary, their indices in batches."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.corpus.batches import Pairs
from motionary.corpus.caption_words import captions_vocabulary
from motionary.corpus.store import Corpus
from motionary.language import UNKNOWN, as_written


@pytest.fixture(scope="module")
def corpus(pipeline):
    return Corpus.open(pipeline / "data/corpus")


def test_inflected_words_stay_and_marks_go():
    sentence = as_written("A man's walking, then he doesn't stop: 2 turns!")
    assert sentence.words == ("a", "man", "walking", "then", "he", "does", "not", "stop", "two", "turns")
    assert set(sentence.tags) == {"OTHER"}
    assert as_written("...").words == ()


def test_batches_hold_the_words_that_were_written(corpus):
    vocabulary = captions_vocabulary(corpus)
    assert "walks" in vocabulary
    assert "walks" not in corpus.context.vocabulary
    pairs = Pairs(corpus, "train", motion=False, all_captions=True, max_words=30, written=vocabulary)
    batch = pairs.collate(np.arange(12), np.random.default_rng(0))
    for place, caption in enumerate(batch.caption.tolist()):
        words = batch.words[place].numpy()
        assert UNKNOWN not in words
        assert vocabulary.decode(words) == " ".join(as_written(corpus.captions.text[caption]).words)
        assert int(batch.word_count[place]) == len(as_written(corpus.captions.text[caption]).words) + 2
    plain = Pairs(corpus, "train", motion=False, all_captions=True).collate(np.arange(12), np.random.default_rng(0))
    assert (plain.text_key == batch.text_key).all()
