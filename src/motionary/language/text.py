"""From raw text to clean tokens, and the checks on text that a user hands in."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping

from motionary.errors import InputError

LONGEST_PROMPT = 1000  # characters

_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z][a-z])")  # "KickFlip" in motion indices is two words
_CONTRACTIONS = (
    (re.compile(r"\bcan't\b"), "can not"),
    (re.compile(r"\bwon't\b"), "will not"),
    (re.compile(r"n't\b"), " not"),
    (re.compile(r"\b(it|he|she|that|there|who|what)'s\b"), r"\1 is"),
    (re.compile(r"'(?:re|m)\b"), " is"),
    (re.compile(r"'ve\b"), " have"),
    (re.compile(r"'ll\b"), " will"),
    (re.compile(r"'(?:s|d)?(?!\w)"), " "),  # the rest: possessives and quotation marks
)
_TURNING = re.compile(r"\b(?:(counter|anti)[- ]?)?clock[- ]?wise\b")
_TPOSE = re.compile(r"\b(?:t[- ]|a-)pose\b")
# A number, a word (letters of any script) or one punctuation mark, which only the tagger sees.
_TOKEN = re.compile(r"\d+|[^\W\d_]+|[.,;:!?()]")
_ACCENTED = re.compile(r"([A-Za-z])[\u0300-\u036f]+")
_SMALL = ("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")
_NUMBERS: dict[str, str] = {str(number): word for number, word in enumerate(_SMALL)}


def tokenize(text: str) -> list[str]:
    """Lower-case words and punctuation marks of a text.

    Accents of Latin letters are folded, hyphens and slashes part words, contractions are written out, small numbers
    become words ("4 hops" and "four hops" are the same) and "counter-clockwise" has one spelling.
    """
    text = unicodedata.normalize("NFKC", text).replace("\u2019", "'").replace("`", "'")
    text = _fold_accents(_CAMEL.sub(" ", text).lower())
    for pattern, replacement in _CONTRACTIONS:
        text = pattern.sub(replacement, text)
    text = _TURNING.sub(lambda match: "counterclockwise" if match[1] else "clockwise", text)
    text = _TPOSE.sub(lambda match: match[0][0] + "pose", text)
    words: list[str] = _TOKEN.findall(text)
    return [_NUMBERS.get(word, word) for word in words]


def is_word(token: str) -> bool:
    """Whether a token of `tokenize` is a word or a number rather than punctuation."""
    return token[0].isalnum()


def check_prompt(text: object, what: str = "text") -> str:
    """Return the text without surrounding blanks; raise for what no model can read.

    Args:
        text: what a user or a file gave.
        what: the argument or file to name in the error.

    Raises:
        InputError: not a string, blank, without any word, longer than 1000 characters, or mostly not in Latin letters.

    A text of more than 20 words is no error: models read its first 20 (`Vocabulary.encode`).
    """
    if not isinstance(text, str):
        raise InputError(what, repr(text), "must be a string")
    stripped = text.strip()
    if not stripped:
        raise InputError(what, repr(text), "must not be empty")
    if len(stripped) > LONGEST_PROMPT:
        raise InputError(what, stripped, f"must have at most {LONGEST_PROMPT} characters, has {len(stripped)}")
    letters = [letter for letter in _fold_accents(stripped) if letter.isalpha()]
    latin = sum(letter.isascii() for letter in letters)
    if 2 * latin < len(letters):
        raise InputError(what, stripped, "must be English, in Latin letters")
    if not any(is_word(token) for token in tokenize(stripped)):
        raise InputError(what, stripped, "must contain a word")
    return stripped


def with_words(text: str, words: Mapping[str, str]) -> str:
    """The text with other words in the place of some, given as lemmas: their endings stay as they were written."""
    if not words:
        return text
    olds = "|".join(map(re.escape, sorted(words, key=len, reverse=True)))  # the longest that fits
    return re.sub(rf"\b({olds})", lambda found: words.get(found[0].lower(), found[0]), text, flags=re.IGNORECASE)


def _fold_accents(text: str) -> str:
    if text.isascii():
        return text
    return unicodedata.normalize("NFC", _ACCENTED.sub(r"\1", unicodedata.normalize("NFKD", text)))
