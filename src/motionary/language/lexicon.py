"""Words and their classes: the motion dictionary, lemma overrides and part-of-speech tags.

The 15 classes are nine parts of speech, the five of a hand-written motion dictionary (thesis 4.2.3, text encoder) and
OTHER. The dictionary (``dictionary.json``) holds lemmas; their inflections are generated here, so that an action verb
finds its lemma whatever the tagger thinks of it ("waves" is no noun here, and "left" never the past of "leave").
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib.resources import files

TAGS: tuple[str, ...] = (
    *("VERB", "NOUN", "DET", "ADP", "NUM", "AUX", "PRON", "ADJ", "ADV"),
    *("LOCATION", "BODY_PART", "OBJECT", "ACTION", "DESCRIPTION", "OTHER"),
)
TAG_IDS = {tag: index for index, tag in enumerate(TAGS)}
OTHER = "OTHER"

_CLASSES = ("location", "body_part", "object", "action", "description")  # in order of precedence
_PARTS_OF_SPEECH = {**{tag: tag for tag in TAGS[:9]}, "PROPN": "NOUN"}
_POSSESSIVES = frozenset({"his", "her", "their", "its", "my", "your", "our"})
_DOUBLING = re.compile(r"^(?:[^aeiou]|qu)*[aeiou][bdgklmnprtvz]$")  # stop, squat; not box, show, lean


def inflections(lemma: str) -> tuple[str, ...]:
    """Regular plural, third person, past and -ing forms of a noun or verb, misspelled ones left out."""
    if re.search(r"(s|x|z|ch|sh|o)$", lemma):
        third = lemma + "es"
    elif re.search(r"[^aeiou]y$", lemma):
        third = lemma[:-1] + "ies"
    else:
        third = lemma + "s"
    if lemma.endswith("ie"):
        return third, lemma + "d", lemma[:-2] + "ying"
    if re.search(r"[^eoy]e$", lemma):
        return third, lemma + "d", lemma[:-1] + "ing"
    if lemma.endswith("e"):
        return third, lemma + "d", lemma + "ing"
    if re.search(r"[^aeiou]y$", lemma):
        return third, lemma[:-1] + "ied", lemma + "ing"
    if _DOUBLING.match(lemma):
        return third, lemma + lemma[-1] + "ed", lemma + lemma[-1] + "ing"
    return third, lemma + "ed", lemma + "ing"


@dataclass(frozen=True)
class Lexicon:
    """Word classes and lemmas by table; everything the tables do not know is left to the tagger."""

    classes: dict[str, tuple[str, ...]]  # class -> lemmas
    overrides: dict[str, str]  # surface form -> lemma
    keep: frozenset[str]  # surface forms that are their own lemma

    @cached_property
    def members(self) -> dict[str, tuple[str, ...]]:
        """Lemma -> its dictionary classes, in order of precedence."""
        found: dict[str, tuple[str, ...]] = {}
        for name in _CLASSES:
            for word in self.classes[name]:
                found[word] = (*found.get(word, ()), name)
        return found

    @cached_property
    def lemmas(self) -> dict[str, str]:
        """Surface form -> lemma, for each form the tables decide. A listed word is its own lemma."""
        forms: dict[str, str] = {}
        for name in ("body_part", "object", "action"):
            for word in self.classes[name]:
                shapes = inflections(word)
                for shape in shapes if name == "action" else shapes[:1]:
                    forms.setdefault(shape, word)
        forms.update({word: word for word in self.members})
        forms.update(self.overrides)
        forms.update({word: word for word in self.keep})
        return forms

    def lemma(self, word: str, part_of_speech: str = "", suggestion: str = "") -> str:
        """Lemma of a lower-case word. The tagger's ``suggestion`` counts for nouns and verbs only.

        Tense and plural are ignored, as in TM2T 4.3; determiners, pronouns and the rest stay as written.
        """
        if word in self.lemmas:
            return self.lemmas[word]
        if part_of_speech in ("NOUN", "VERB", "PROPN") and suggestion:
            return self.lemmas.get(suggestion, suggestion)
        return word

    def tag(self, lemma: str, part_of_speech: str, previous: str = "", default: str = OTHER) -> str:
        """One of `TAGS`. Dictionary classes go before parts of speech.

        Of several classes the first of location, body part, object, action and description counts, but a verb that
        can be an action is one ("hands over a box"), "their back" is a body part and "a slow walk" a description.
        ``default`` counts where it is one of the word's classes, and for a word of no class.
        """
        classes = self.members.get(lemma)
        if not classes:
            return _PARTS_OF_SPEECH.get(part_of_speech, default)
        if default.lower() in classes:
            return default
        if "body_part" in classes and previous in _POSSESSIVES:
            return "BODY_PART"
        if "action" in classes and part_of_speech == "VERB":
            return "ACTION"
        if "description" in classes and part_of_speech in ("ADJ", "ADV"):
            return "DESCRIPTION"
        return classes[0].upper()


@lru_cache(maxsize=1)
def lexicon() -> Lexicon:
    """The packaged tables, read once."""
    folder = files("motionary.language")
    classes = json.loads((folder / "dictionary.json").read_text(encoding="utf-8"))
    tables = json.loads((folder / "overrides.json").read_text(encoding="utf-8"))
    return Lexicon({name: tuple(classes[name]) for name in _CLASSES}, tables["lemmas"], frozenset(tables["keep"]))


def tag_ids(tags: Sequence[str]) -> list[int]:
    """Indices into `TAGS`; tags that are not among them count as OTHER."""
    return [TAG_IDS.get(tag, TAG_IDS[OTHER]) for tag in tags]
