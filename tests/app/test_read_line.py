"""What the page says of a prompt, as markdown: no text of a visitor is a tag there."""

from __future__ import annotations

import re

from motionary.app.generate_tab import read_line
from motionary.language import PromptReading, Sentence


def test_every_letter_of_a_prompt_is_shown():
    text = "<img src=x onerror=alert(1)> *walks* [away](http://a) xqzt"
    sentence = Sentence(text, ("img", "walk", "<unknown>"), ("NOUN", "ACTION", "OTHER"))
    reading = PromptReading(sentence, {"img": "person"}, ("xqzt",), (), 0.6, "a <b>bold</b> person")
    line = read_line(reading)
    assert not re.search(r"(?<!\\)[<>*\[\]()_]", line)
    assert r"\<unknown\>" in line
    assert r"\<img src=x" in line
    assert "xqzt" in line
    assert r"0.60 from the nearest training caption" in line


def test_a_prompt_that_is_known_is_one_line():
    sentence = Sentence("he walks", ("person", "walk"), ("NOUN", "ACTION"))
    assert read_line(PromptReading(sentence)) == "Read as: person walk"


def test_where_parts_go_is_said():
    sentence = Sentence("he walks, then waves", ("person", "walk", "then", "wave"), ("NOUN", "ACTION", "ADV", "ACTION"))
    assert "under How" in read_line(PromptReading(sentence))
