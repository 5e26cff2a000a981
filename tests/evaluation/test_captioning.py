"""Scores of captioners whose outcome is known: beam search and consensus are told apart."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.corpus.store import Corpus
from motionary.evaluation.captioning import CONSENSUS, score_captioner
from motionary.evaluation.items import Items
from motionary.evaluation.jury import Jury
from motionary.evaluation.scores import Protocol

PROTOCOL = Protocol(repetitions=2, pool=4, diversity_pairs=5, batch_size=3, bert_score=False)


class ByLength:
    """A judge that sees only lengths."""

    def motions(self, features):
        return np.array([[len(f), 1.0] for f in features])

    def sentences(self, sentences):
        return np.array([[len(s.words), 1.0] for s in sentences], float)


class Parrot:
    """Says a fixed caption by beam search, and by consensus what the item's own reference says."""

    draws, written = True, False

    def __init__(self, items: Items):
        self.said = [" ".join(options[0].words) for options in items.references]
        self.place = {id(f): i for i, f in enumerate(items.features)}
        self.asked: list[tuple[int, list[int] | None]] = []

    def caption(self, features, beams, seeds=None, consensus=0):
        assert beams == 2
        self.asked.append((consensus, None if seeds is None else list(seeds)))
        own = [self.said[self.place[id(f)]] for f in features]
        return [[text if consensus else "a person sleep"] for text in own]


class Plain(Parrot):
    draws = False


@pytest.fixture(scope="module")
def items(pipeline):
    return Items(Corpus.open(pipeline / "data/corpus"))


def test_consensus_is_scored_beside_beam_search(items):
    parrot = Parrot(items)
    report = score_captioner(parrot, items, Jury({"length": ByLength()}, PROTOCOL))
    assert report["consensus"]["draws"] == CONSENSUS
    assert report["consensus"]["language"]["all"]["bleu4"]["mean"] == pytest.approx(1.0)
    assert report["language"]["all"]["bleu4"]["mean"] < 0.1
    assert report["consensus"]["action"]["all"]["named"] == 1.0
    assert report["action"]["all"]["named"] == 0.0
    # Captions that are the references stand to the motions as the references do.
    assert report["consensus"]["captioning"] == report["real"]
    assert report["captioning"] != report["real"]
    drawn = [seed for consensus, seeds in parrot.asked if consensus for seed in seeds]
    assert drawn == list(range(len(items)))  # every item its own noise, whatever the batches


def test_a_captioner_that_cannot_draw_is_scored_once(items):
    plain = Plain(items)
    report = score_captioner(plain, items, Jury({"length": ByLength()}, PROTOCOL))
    assert "consensus" not in report
    assert {consensus for consensus, _ in plain.asked} == {0}


class Writer(Plain):
    """Writes the item's first reference as it was written."""

    written = True

    def caption(self, features, beams, seeds=None, consensus=0):
        return [[self.raw[self.place[id(f)]]] for f in features]


def test_captions_in_written_words_are_scored_raw_as_they_are_and_normalized_beside_the_others(items):
    writer = Writer(items)
    writer.raw = [options[0].text for options in items.references]
    report = score_captioner(writer, items, Jury({"length": ByLength()}, PROTOCOL))
    normal = score_captioner(Parroting(items), items, Jury({"length": ByLength()}, PROTOCOL))
    assert report["language"]["all"]["bleu4"]["mean"] == pytest.approx(1.0)
    assert report["language"]["all"]["raw"]["bleu4"]["mean"] == pytest.approx(1.0)
    assert normal["language"]["all"]["bleu4"]["mean"] == pytest.approx(1.0)
    assert normal["language"]["all"]["raw"]["bleu4"]["mean"] < 0.9


class Parroting(Plain):
    """Says the item's first reference in normalized words."""

    def caption(self, features, beams, seeds=None, consensus=0):
        return [[self.said[self.place[id(f)]]] for f in features]
