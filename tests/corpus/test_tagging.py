"""Captions are tagged alike by one process and by several."""

from __future__ import annotations

from motionary.corpus import tagging
from motionary.language import annotate


def test_several_processes_tag_as_one_does(monkeypatch):
    monkeypatch.setattr(tagging, "_PART", 3)
    texts = ["a person waves", "someone walks left", "a man jumps", "she kicks twice", "???", "a person waves"]
    known, problems = tagging.tagged(texts, workers=2, progress=False)
    assert known == dict(zip(texts, annotate(texts), strict=True))
    assert problems == []
