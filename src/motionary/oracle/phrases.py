"""The words of captions: verbs, clauses, limbs, directions and counts."""

from __future__ import annotations

import re
from collections.abc import Iterator

MANY = float("inf")
_NUMBERS = {"one": 1, "two": 2, "three": 3, "four": 4, "five": 5, "six": 6, "seven": 7, "eight": 8}
_LIMB = r"(?:hands?|arms?|fists?|legs?|foot|feet|knees?|palms?)"
_VERBS = {
    "jack": r"jumping jacks?",
    "circle": r"(?:walk|go|run|jog|mov)\w*(?: \w+){0,2} (?:in|round|around) (?:a |the )?(?:\w+ )?circles?",
    "swing": r"(?:swing|circl|rotat|spin)\w* (?:the |his |her |their )?(?:left |right |both )?(?:hands?|arms?)",
    "sit": r"(?:sits?|sitting|sat)\b",
    "squat": r"(?:squat\w*|crouch\w*)",
    "bow": r"(?:bows?|bowing|bowed|bends? (?:forwards?|over|down))\b",
    "lean": r"(?:leans?|leaning|bends?|bending)\b",
    "pick": r"(?:picks?|picking|picked)\b",
    "knee": r"(?:lift\w*|rais\w*) (?:the |his |her |their )?(?:left |right )?knees?",
    "raise": r"(?:rais\w+|lift\w*|puts? up|holds? up)\b(?=.*\b(?:hands?|arms?)\b)",
    "wave": r"(?:wav(?:e|es|ing|ed)|bye)\b",
    "punch": r"(?:punch\w*|box\w*|jabs?)",
    "kick": r"kick\w*",
    "clap": r"(?:clap\w*|applaud\w*)",
    "hop": r"hop(?:s|ping|ped)?\b",
    "jump": r"(?:jump\w*|leap\w*)",
    "turn": r"(?:turn\w*|rotat\w+|spin\w*|pivot\w*|curv\w+)",
    "run": r"(?:runs?|running|ran|jog\w*|sprint\w*|dash\w*)\b",
    "march": r"march\w*(?: (?:in place|on the spot))?(?: for)?(?: \w+ steps?)?",
    "walk": r"(?:walk\w*|stroll\w*|steps?|stepping|stepped|strides?)\b",
    "lunge": r"lung(?:e|es|ing|ed)\b",
    "point": r"point\w*",
    "stand": r"stands? (?:still|in place)",
    # Words that begin another clause, of which the oracle reads nothing.
    "other": r"(?:throw|toss|look|reach|hold|grab|put|plac|danc|crawl|fall|climb|stretch|stir|swim|catch|drink)\w*",
}
_ANY_VERB = re.compile("|".join(f"(?P<{name}>\\b{pattern})" for name, pattern in _VERBS.items()))

_NUMBERED = re.compile(rf"(?:\b(?:an?|{'|'.join(_NUMBERS)}|[1-9]) (?:\w+ )?)?$")


def clauses(text: str) -> Iterator[tuple[str, str]]:
    """(verb, its words): from the number before it ("two lunges") to the next verb; the first one has all before it."""
    found = [(m.lastgroup or "", m.start()) for m in _ANY_VERB.finditer(text)]
    starts = [0]
    for _, start in found[1:]:
        number = _NUMBERED.search(text[:start])
        starts.append(number.start() if number else start)
    for k, (verb, _) in enumerate(found):
        yield verb, text[starts[k] : starts[k + 1] if k + 1 < len(found) else len(text)]


def limb_in(clause: str) -> str | None:
    """Side of the limb that acts: "left", "right", "both"."""
    if match := re.search(rf"\b(left|right|both)(?: \w+)? {_LIMB}\b", clause):
        return match[1]
    return "both" if re.search(r"\b(?:the|his|her|their|two|all) (?:hands|arms)\b", clause) else None


def way_in(clause: str) -> str | None:
    """Where to: "left", "right", "forward", "backward"."""
    clause = re.sub(rf"\b(left|right)(?: \w+)? {_LIMB}\b", "", clause)
    if "back and forth" in clause:
        return None
    if match := re.search(r"\b(left|right)\b|\b(left|right)wards?\b", clause):
        return match[1] or match[2]
    if re.search(r"\bcounter ?clockwise\b", clause):
        return "left"
    if re.search(r"\bclockwise\b", clause):
        return "right"
    if re.search(r"\bbackwards?\b|\bback\b", clause):
        return "backward"
    return "forward" if re.search(r"\bforwards?\b|\bahead\b|\bstraight\b", clause) else None


def count_in(clause: str, noun: str = "times?|steps?") -> tuple[float, float]:
    """How often: exactly, or at least once."""
    for word, times in (("once", 1), ("twice", 2), ("thrice", 3)):
        if re.search(rf"\b{word}\b", clause):
            return times, times
    if match := re.search(rf"\b({'|'.join(_NUMBERS)}|[1-9]) (?:\w+ )?(?:{noun})\b", clause):
        times = _NUMBERS.get(match[1]) or int(match[1])
        return times, times
    return (1, 1) if re.search(rf"\ban? (?:{noun})\b", clause) else (1, MANY)
