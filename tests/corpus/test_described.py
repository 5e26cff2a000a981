"""Captioned windows as judges read them."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.corpus.batches import Batches, Pairs
from motionary.corpus.described import Described, EvenSources
from motionary.corpus.store import Corpus
from motionary.language import STATE_DIM, TextStates, sentence_embeddings


@pytest.fixture(scope="module")
def corpus(pipeline):
    return Corpus.open(pipeline / "data/corpus")


@pytest.fixture(scope="module")
def states():
    return TextStates()


def test_the_mean_of_token_states_is_the_sentence_s_embedding(states):
    texts = ["a person walks", "a person waves with the left hand for a while", "a person walks"]
    found, count = states(texts)
    assert found.shape == (3, int(count.max()), STATE_DIM)
    assert np.array_equal(found[0], found[2])
    mean = found.sum(1) / count[:, None]
    mean /= np.linalg.norm(mean, axis=1, keepdims=True)
    np.testing.assert_allclose(mean, sentence_embeddings(texts), atol=2e-3)


def test_joints_are_those_of_the_windows_and_states_those_of_the_captions(corpus, states):
    pairs = Pairs(corpus, "test", drop_unit=0, motion=False, all_captions=True)
    batch = Described(pairs, states, joints=True, raw=True).collate(np.array([0, 3]), np.random.default_rng(0))
    assert not hasattr(batch, "motion")
    for place, row in enumerate(batch.clip.tolist()):
        positions, count = corpus.motion(row).positions, int(batch.frames[place])
        np.testing.assert_allclose(batch.joints[place, :count], positions, atol=1e-3)
        assert not batch.joints[place, count:].any()
        expected, tokens = states([str(corpus.captions.text[batch.caption[place]])])
        assert int(batch.state_count[place]) == tokens[0]
        np.testing.assert_array_equal(batch.states[place, : tokens[0]], expected[0])


def test_every_second_caption_is_read_as_normalized_words_but_not_in_validation(corpus, states):
    pairs = Pairs(corpus, "train", drop_unit=0, motion=False)
    mixed, raw = Described(pairs, states), Described(pairs, states, raw=True)
    assert raw.texts.tolist() == corpus.captions.text.tolist()
    assert mixed.texts[::2].tolist() == corpus.captions.text[::2].tolist()
    assert mixed.texts[1::2].tolist() == [" ".join(words) for words in corpus.captions.words[1::2]]


def test_every_source_counts_alike(corpus):
    pairs = Pairs(corpus, "train", drop_unit=0, all_captions=True)
    source = np.full(len(corpus.captions), "many", dtype=object)
    own = pairs.first
    source[own[:10]], source[own[10:12]] = "few", "two"
    captions = corpus.captions
    known = captions.source
    object.__setattr__(captions, "source", source)
    try:
        even = EvenSources(pairs, together=4)
    finally:
        object.__setattr__(captions, "source", known)
    assert even.sources == ("few", "many")  # two captions find each other by chance
    found = [source[batch.caption.numpy()] for batch in Batches(even, 4, shuffle=False).epoch(0)]
    assert all(len(set(names)) == 1 for names in found)
    names, counts = np.unique(np.concatenate(found), return_counts=True)
    assert names.tolist() == ["few", "many"]
    assert counts[0] == counts[1]
    assert set(own[:10]) <= set(pairs.first[even.entries])
