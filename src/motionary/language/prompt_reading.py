"""How a prompt is read: its words, or what stands for those that the training captions do not have."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from motionary.language.annotate import Sentence
from motionary.language.lexicon import lexicon
from motionary.language.meanings import Meanings
from motionary.language.spelling import is_english
from motionary.language.synonyms import synonym
from motionary.language.text import tokenize, with_words
from motionary.language.vocabulary import SPECIAL, UNKNOWN, Vocabulary

FAR = 0.45  # from the nearest training caption: docs/bundle.md measures what people's captions have
_NEGATIONS = frozenset(("not", "never", "no", "without", "cannot", "dont", "doesnt", "nobody", "none"))
_SHORTEST = 3  # letters of a word that is read by its meaning
# Words that mean the same to a motion: of each row the first that a corpus has stands for the others.
_PEOPLE = (
    *("person", "someone", "somebody", "man", "woman", "human", "figure", "subject", "character", "individual"),
    *("he", "she", "they", "him", "them", "i", "me", "you", "we", "us", "guy", "boy", "girl", "lady", "gentleman"),
    *("people", "anyone", "anybody", "everyone", "child", "kid", "adult", "male", "female", "player", "actor"),
)
_COMMON = (
    _PEOPLE,
    ("their", "his", "her", "its", "my", "your", "our"),
    ("a", "the", "an", "this", "that", "these", "those", "some"),
    ("then", "next", "afterwards", "and", "before", "after", "while", "as"),
    ("start", "begin"),
    ("stop", "end", "finish"),
)
# Words that can be left out of a prompt without losing anything about the motion.
_EMPTY = frozenset(
    (
        *("do", "does", "is", "has", "have", "will", "would", "can", "could", "to", "of", "at", "for", "in", "on"),
        *("with", "by", "from", "into", "onto", "as", "so", "very", "just", "really", "please", "there", "here", "it"),
        *("himself", "herself", "themselves", "itself", "myself", "yourself", "which", "who", "what"),
    )
)
# Little words of German, French, Spanish, Italian, Portuguese and Dutch that are no English ones: where a corpus does
# not know one, words beside it that look English are hardly meant so.
_NOT_ENGLISH = frozenset(
    (
        *("der", "das", "dem", "ein", "eine", "einen", "einem", "einer", "und", "mit", "auf", "nach", "zum", "sich"),
        *("une", "les", "des", "avec", "elle", "dans", "vers", "el", "los", "las", "una", "hacia", "gli", "della"),
        *("uma", "het", "een", "naar"),
    )
)


@dataclass(frozen=True)
class PromptReading:
    """A text as systems read it.

    Attributes:
        sentence: the words that they read; ``<unknown>`` where nothing known comes near.
        replaced: words of the text that the training captions do not have -> the known word read in its place.
        unknown: words for which nothing stands.
        guessed: those of `replaced` that are read as what is nearest in meaning; the others are typos and synonyms.
        distance: cosine distance of what is `compared` to the nearest training caption by the packaged sentence model;
            None where the captions are not at hand or nobody asked.
        nearest: that caption.
    """

    sentence: Sentence
    replaced: Mapping[str, str] = field(default_factory=dict)
    unknown: tuple[str, ...] = ()
    guessed: tuple[str, ...] = ()
    distance: float | None = None
    nearest: str | None = None

    @property
    def words(self) -> str:
        """What was read, joined by blanks."""
        return self.sentence.normalized

    @property
    def negations(self) -> tuple[str, ...]:
        """Words of the text that turn its sense round, which hardly any training caption does."""
        return tuple(word for word in dict.fromkeys(tokenize(self.sentence.text)) if word in _NEGATIONS)

    @property
    def compared(self) -> str:
        """The text whose distance is measured: as written, but for typos and synonyms, which are read as they were
        meant. Guesses stay as written, so that the distance tells how far from anything known they were made."""
        return with_words(self.sentence.text, {o: n for o, n in self.replaced.items() if o not in self.guessed})

    @property
    def english(self) -> bool:
        """Whether the text seems to be English: no little word of another language, and not mostly words that are not
        known."""
        words, unknown = len(self.sentence.words), len(self.unknown)
        strange = sum(word in self.guessed or not is_english(word) for word in self.replaced)
        known = 2 * unknown < words and 2 * (unknown + strange) <= words
        return known and _NOT_ENGLISH.isdisjoint((*self.unknown, *self.replaced))

    @property
    def line(self) -> str:
        """What a reader should know of it, in one line; empty where the text is read as it stands."""
        far = self.distance is not None and self.distance > FAR
        if not (self.replaced or self.unknown or far or self.negations):
            return ""
        parts = [f'"{self.sentence.text}" is read as "{self.words}"']
        if self.replaced:
            parts.append("not known: " + ", ".join(f"{old} (nearest: {new})" for old, new in self.replaced.items()))
        if self.unknown:
            parts.append(f"without any meaning here: {', '.join(self.unknown)}")
        if not self.english:
            parts.append("prompts are read in English")
        if self.negations:
            parts.append(f"say what is to happen, not what is not: systems hardly know {' '.join(self.negations)}")
        if self.distance is not None:
            what = "far from anything known: " if far else ""
            parts.append(f'{what}{self.distance:.2f} from the nearest training caption, "{self.nearest}"')
        return "; ".join(parts)

    def record(self) -> dict[str, Any]:
        """The same as plain values: "read_as", "replaced", "unknown", "distance", "nearest"."""
        distance = None if self.distance is None else round(self.distance, 4)
        told = {"read_as": self.words, "replaced": dict(self.replaced), "unknown": list(self.unknown)}
        return told | {"distance": distance, "nearest": self.nearest}

    def measured(self, meanings: Meanings) -> PromptReading:
        """With its distance to the nearest training caption, where there are captions."""
        distance, nearest = meanings.distance(self.compared) or (None, None)
        return replace(self, distance=distance, nearest=nearest)


def read(sentence: Sentence, vocabulary: Vocabulary, meanings: Callable[[], Meanings]) -> PromptReading:
    """A sentence in words of the vocabulary.

    A word that is not there is read as a form of it, as what a typo meant, as a common word of the same use ("he", "a
    person"), as a synonym, or as the word nearest in meaning; auxiliaries and prepositions are left out. What is no
    English word keeps the mark ``<unknown>``; so does what negates, which nothing else stands for.

    Args:
        sentence: as :func:`annotate` gives it.
        vocabulary: of the training captions.
        meanings: opens their meanings; called where a word needs one.
    """
    words: list[str] = []
    tags: list[str] = []
    replaced: dict[str, str] = {}
    unknown: list[str] = []
    guessed: list[str] = []
    for old, new, tag in zip(sentence.words, vocabulary.correct(sentence).words, sentence.tags, strict=True):
        if new == SPECIAL[UNKNOWN]:
            common = _common(old, vocabulary)
            new = common if common is not None else _meant(old, tag, vocabulary, meanings)
            if common is None:
                replaced |= {old: new} if new else {}
                unknown += [] if new else [old]
                guessed += [old] if new and new != synonym(old, vocabulary.__contains__) else []
        elif new != old:
            replaced[old] = new
        if new != "":
            words.append(new or SPECIAL[UNKNOWN])
            previous = words[-2] if len(words) > 1 else ""
            tags.append(tag if new in (None, old) else lexicon().tag(new, tag, previous, default=tag))
    if not words:
        return PromptReading(Sentence(sentence.text, (SPECIAL[UNKNOWN],), ("OTHER",)), {}, sentence.words)
    told = Sentence(sentence.text, tuple(words), tuple(tags))
    return PromptReading(told, replaced, tuple(unknown), tuple(guessed))


def _common(word: str, vocabulary: Vocabulary) -> str | None:
    """What stands for a common word: "" where it can be left out, None where the word is no common one."""
    for row in _COMMON:
        if word in row:
            return next((other for other in row if other in vocabulary), "")
    return "" if word in _EMPTY else None


def _meant(word: str, tag: str, vocabulary: Vocabulary, meanings: Callable[[], Meanings]) -> str | None:
    if word in _NEGATIONS:
        return None
    same = synonym(word, vocabulary.__contains__)
    if same is not None or len(word) < _SHORTEST or not is_english(word):
        return same
    return meanings().nearest(word, tag)
