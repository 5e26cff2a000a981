"""Captions normalized and tagged in parallel: a thousand texts at a time, each process with a tagger of its own."""

from __future__ import annotations

from collections.abc import Sequence

from tqdm import tqdm

from motionary.corpus.checks import unforeseen
from motionary.corpus.workers import in_order
from motionary.errors import InputError
from motionary.language import Sentence, annotate

_PART = 1000


def tagged(texts: Sequence[str], workers: int, progress: bool) -> tuple[dict[str, Sentence], list[InputError]]:
    """The sentence of each distinct text, and a problem for each text that no tagger can read (it has no words)."""
    texts = sorted(set(texts))
    parts = [(texts[i : i + _PART],) for i in range(0, len(texts), _PART)]
    known: dict[str, Sentence] = {}
    problems: list[InputError] = []
    with tqdm(total=len(texts), desc="captions", unit="text", disable=not progress) as bar:
        for (part,), (sentences, wrong) in zip(parts, in_order(_annotated, parts, workers, chunk=1), strict=True):
            known.update(zip(part, sentences, strict=True))
            problems += wrong
            bar.update(len(part))
    return known, problems


def _annotated(texts: list[str]) -> tuple[list[Sentence], list[InputError]]:
    """Sentences of texts in order; what fails must not end a run after hours of encoding."""
    try:
        return annotate(texts), []
    except Exception as error:
        if len(texts) == 1:
            return [Sentence(texts[0], (), ())], [unforeseen(f"caption {texts[0]!r}", error)]
    alone = [_annotated([text]) for text in texts]
    return [one for sentences, _ in alone for one in sentences], [one for _, wrong in alone for one in wrong]
