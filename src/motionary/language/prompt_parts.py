"""Prompts that tell of several motions, one after the other."""

from __future__ import annotations

import re

from motionary.language.annotate import Sentence, annotate

# "walks and turns right" is one motion to captions and systems; what these words join is done one after the other.
_NEXT = re.compile(
    r"[,;.]?\s+(?:and\s+|but\s+)?(?:then|after(?:wards?|\s+that)|before|followed\s+by)\b[,\s]*(?:and\s+|then\s+)*",
    re.IGNORECASE,
)


def prompt_parts(text: str) -> tuple[str, ...]:
    """The parts of a prompt that follow each other in time, in its own words: one, unless the text says "then",
    "afterwards", "before" or the like between two parts that each say what is done.

    A part without a verb ("stands before a table") does not count; "after", which turns the order round, parts nothing.
    """
    found = tuple(part.strip(" ,;.") for part in _NEXT.split(text))
    if len(found) > 1 and all(map(_acts, annotate(found))):
        return found
    return (text,)


def _acts(sentence: Sentence) -> bool:
    """Whether a text says that something is done."""
    return any(tag in ("ACTION", "VERB") for tag in sentence.tags)
