"""Sentences asked of a dictionary: the oracle counts the seeds whose motions show them."""

from __future__ import annotations

import pytest

from motionary.bench.asked import asked, main
from motionary.corpus.demo import demo_clip
from motionary.oracle.prompts import confirm


class Repeats:
    """Answers seed k with the clip k of the demo corpus, whatever is asked."""

    def generate(self, text, seed, system):
        return [demo_clip(seed)[0]]


def test_seeds_whose_motions_show_the_sentence_are_counted():
    text = demo_clip(3)[1]["captions"][0]  # the clip of its own seed shows it
    right = sum(confirm(demo_clip(seed)[0], text) for seed in range(6))
    assert 1 <= right < 6
    assert asked(Repeats(), [text], 6).rows == [[text, f"{right} of 6"]]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["a person thinks"], "error: text: a person thinks: says nothing"),
        (["a person runs", "--seeds", "0"], "error: --seeds: 0: must be at least 1"),
    ],
)
def test_what_cannot_be_asked_is_one_line(arguments, told, pipeline, capsys):
    assert main([*arguments, "--models", str(pipeline / "models")]) == 2
    assert capsys.readouterr().err.startswith(told)


def test_the_command_asks_the_trained_models(pipeline, capsys):
    assert main(["a person walks forward", "--seeds", "2", "--models", str(pipeline / "models")]) == 0
    assert "| a person walks forward | " in capsys.readouterr().out
