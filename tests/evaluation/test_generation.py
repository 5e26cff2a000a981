"""Scores of generators and codecs whose outcome is known: what real lengths change, and what a codec loses."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.corpus.store import Corpus
from motionary.evaluation.confirmation import confirmed
from motionary.evaluation.generation import others, score_generator
from motionary.evaluation.items import Items, sentence_of
from motionary.evaluation.jury import Jury
from motionary.evaluation.round_trip import score_reconstructor
from motionary.evaluation.scores import Protocol

PROTOCOL = Protocol(
    repetitions=2, pool=4, diversity_pairs=5, multimodality_texts=2, multimodality_samples=4, multimodality_pairs=2,
    prompt_samples=1, batch_size=3,
)  # fmt: skip


class ByLength:
    """A judge that sees nothing of a motion but its length."""

    def motions(self, features):
        lengths = np.array([len(f) for f in features], float)
        return np.stack([lengths / 20, np.sin(lengths)], axis=1)

    def sentences(self, sentences):
        lengths = np.array([len(s.words) for s in sentences], float)
        return np.stack([lengths, lengths], axis=1)


class ByWords(ByLength):
    """Another, for which all motions are alike."""

    def motions(self, features):
        return np.ones((len(features), 2)) + 1e-3 * (np.arange(len(features))[:, None] % 2)


class Still:
    """Stands for 40 frames, or for as long as it is told."""

    takes_lengths = True

    def __init__(self, dim: int):
        self.dim, self.asked = dim, []

    def generate(self, sentences, seeds, frames=None):
        assert len(sentences) == len(seeds)
        self.asked.append(frames)
        return [np.zeros((n, self.dim), np.float32) for n in (frames or [40] * len(sentences))]


@pytest.fixture(scope="module")
def items(pipeline):
    return Items(Corpus.open(pipeline / "data/corpus"))


def jury(**changes):
    return Jury({"length": ByLength(), "words": ByWords()}, Protocol(**{**vars(PROTOCOL), **changes}))


def scored(generator, items, **changes):
    return score_generator(generator, items, jury(**changes))


def test_at_the_real_lengths_a_system_that_fails_only_in_length_is_as_good_as_real(items):
    generator = Still(items.corpus.context.dim)
    report = scored(generator, items)
    held, real = report["real_lengths"], report["real"]
    assert held["generation"] == real
    assert held["generation"]["all"]["fid"]["mean"] == pytest.approx(0, abs=1e-5)
    assert report["generation"]["all"]["fid"]["mean"] > 0.5
    assert held["physics"]["generated"]["seconds"] == report["physics"]["real"]["seconds"]
    assert report["physics"]["generated"]["seconds"] == pytest.approx(2.0)
    planted = report["planted"]
    assert planted.keys() == {"generation", "physics", "oracle"}
    assert planted["physics"]["generated"]["foot_skating"] <= report["physics"]["generated"]["foot_skating"]
    assert held["oracle"]["captions"].keys() == report["oracle"]["captions"].keys()
    lengths = [n for frames in generator.asked if frames is not None for n in frames]
    assert lengths == [len(f) for f in items.features]


def test_chance_is_what_the_oracle_says_of_other_items_motions(items):
    """Each motion is another's, every one is used once, and few of their captions hold."""
    turned = others(items)
    assert all(not np.shares_memory(a, b) for a, b in zip(turned, items.features, strict=True))
    assert sorted(len(f) for f in turned) == sorted(len(f) for f in items.features)
    oracle = scored(Still(items.corpus.context.dim), items)["oracle"]
    assert oracle["captions_chance"]["all"]["confirmed"] < oracle["captions_real"]["all"]["confirmed"]
    assert oracle["captions_chance"]["all"]["checked"] == oracle["captions_real"]["all"]["checked"]


def test_real_lengths_cost_one_more_generation_where_they_mean_something_and_none_elsewhere(items):
    asked = {}
    for name, takes, wanted in (("takes", True, True), ("ignores", False, True), ("off", True, False)):
        generator = Still(items.corpus.context.dim)
        generator.takes_lengths = takes
        report = scored(generator, items, real_lengths=wanted)
        assert ("real_lengths" in report) == (name == "takes")
        asked[name] = generator.asked
    batches = -(-len(items) // PROTOCOL.batch_size)
    assert len(asked["takes"]) == len(asked["off"]) + batches
    assert asked["ignores"] == asked["off"]
    assert not any(asked["off"])


def test_every_repetition_of_the_generation_is_repeated_at_the_real_lengths(items):
    generator = Still(items.corpus.context.dim)
    scored(generator, items, generation_repetitions=3)
    assert sum(len(frames) for frames in generator.asked if frames is not None) == 3 * len(items)


def test_every_judge_has_its_rows_and_they_are_those_of_that_judge_alone(items):
    both = scored(Still(items.corpus.context.dim), items)
    for name, judge in (("length", ByLength()), ("words", ByWords())):
        alone = score_generator(Still(items.corpus.context.dim), items, Jury({name: judge}, PROTOCOL))
        for key in ("generation", "real"):
            for part, row in alone[key].items():
                found = both[key][part]
                assert {k: v for k, v in (found if name == "length" else found["by"][name]).items() if k != "by"} == row
        spread = both["multimodality"] if name == "length" else both["multimodality"]["by"][name]
        assert (spread["mean"], spread["half"]) == (alone["multimodality"]["mean"], alone["multimodality"]["half"])
        assert "by" not in alone["generation"]["all"]
        assert alone["agreement"] == {}
    assert set(both["agreement"]) == {"words"}


def test_judges_that_rank_alike_agree_and_opposed_ones_do_not(items):
    rng = np.random.default_rng(0)
    text, noise = rng.normal(size=(60, 8)), rng.normal(size=(60, 8)) * rng.uniform(0.1, 3, (60, 1))
    near = Jury({"a": ByLength(), "same": ByLength(), "other": ByLength()}, PROTOCOL)
    texts = {"a": text, "same": 2 * text + 1, "other": text}
    motions = {"a": text + noise, "same": 2 * (text + noise) + 1, "other": text + noise[rng.permutation(60)]}
    found = near.agreement(texts, motions)
    assert found["same"] == 1.0
    assert abs(found["other"]) < 0.5


class Codec:
    """Gives motions back, or, where it has `lost` everything, bodies that keep their first pose."""

    def __init__(self, lost: bool):
        self.lost = lost

    def reconstruct(self, features):
        return [np.repeat(f[:1], len(f), axis=0) if self.lost else np.array(f) for f in features]


def test_the_oracle_confirms_what_a_codec_keeps(items):
    kept, lost = (score_reconstructor(Codec(lost), items, jury()) for lost in (False, True))
    captions = items.choose(0)
    sentences = [sentence_of(items.corpus, c) for c in captions]
    real = confirmed(items, sentences, items.features, items.parts(captions))
    assert kept["reconstruction_oracle"] == real
    assert kept["reconstruction"] == kept["real"]
    assert kept["physics"]["reconstructed"] == kept["physics"]["real"]
    assert lost["physics"]["reconstructed"]["bone_change"] < 1e-6  # one pose throughout
    assert lost["reconstruction_oracle"]["all"]["checked"] == real["all"]["checked"]
    assert lost["reconstruction_oracle"]["all"]["confirmed"] < real["all"]["confirmed"]
