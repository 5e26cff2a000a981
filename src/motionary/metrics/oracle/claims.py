"""`expected`: what a caption claims about a motion, in the oracle's own words."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

Claims = dict[str, str | tuple[float, float]]  # attribute -> word, or closed interval

_MANY = float("inf")
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


def expected(text: str) -> Claims | None:
    """What a caption (or an action label) claims: attributes of `read` and the values they should have.

    Claims are words ("left") or closed intervals of numbers. Only what is said counts: "a person kicks" claims no
    side. Order in time is not claimed, and neither are manners ("slowly", "like an old person").

    Args:
        text: an English sentence; "wave-left-hand" serves as well.

    Returns:
        The claims, or None where the oracle understands none.
    """
    text = " ".join(re.sub(r"[^a-z0-9' ]+", " ", text.lower().replace("-", " ")).split())
    found: dict[str, list] = {}
    for verb, clause in _clauses(text):
        for name, value in _RULES[verb](clause):
            found.setdefault(name, []).append(value)
    claims = {name: merged for name, values in found.items() if (merged := _merge(name, values)) is not None}
    return claims or None


def _merge(name: str, values: list) -> str | tuple[float, float] | None:
    """One claim out of those of all clauses; None where they cannot hold together."""
    if isinstance(values[0], tuple):  # "jumps once and then jumps twice"
        return sum(v[0] for v in values), sum(v[1] for v in values)
    words = set(values)
    if name not in ("direction", "gait") and words <= {"left", "right", "both", "none"}:
        words -= {"none"} if len(words) > 1 else set()
        return words.pop() if len(words) == 1 else "both"
    return words.pop() if len(words) == 1 else None


def _clauses(text: str) -> Iterator[tuple[str, str]]:
    """(verb, its words): from the number before it ("two lunges") to the next verb; the first one has all before it."""
    found = [(m.lastgroup or "", m.start()) for m in _ANY_VERB.finditer(text)]
    starts = [0]
    for _, start in found[1:]:
        number = _NUMBERED.search(text[:start])
        starts.append(number.start() if number else start)
    for k, (verb, _) in enumerate(found):
        yield verb, text[starts[k] : starts[k + 1] if k + 1 < len(found) else len(text)]


def _limb(clause: str) -> str | None:
    """Side of the limb that acts: "left", "right", "both"."""
    if match := re.search(rf"\b(left|right|both)(?: \w+)? {_LIMB}\b", clause):
        return match[1]
    return "both" if re.search(r"\b(?:the|his|her|their|two|all) (?:hands|arms)\b", clause) else None


def _way(clause: str) -> str | None:
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


def _count(clause: str, noun: str = "times?|steps?") -> tuple[float, float]:
    """How often: exactly, or at least once."""
    for word, times in (("once", 1), ("twice", 2), ("thrice", 3)):
        if re.search(rf"\b{word}\b", clause):
            return times, times
    if match := re.search(rf"\b({'|'.join(_NUMBERS)}|[1-9]) (?:\w+ )?(?:{noun})\b", clause):
        times = _NUMBERS.get(match[1]) or int(match[1])
        return times, times
    return (1, 1) if re.search(rf"\ban? (?:{noun})\b", clause) else (1, _MANY)


def _sided(name: str, nouns: str) -> Callable[[str], Iterator[tuple]]:
    """Counts of a limb: of the named side exactly; where no side is named, nothing can be claimed of either."""

    def rule(clause: str):
        side, count = _limb(clause), _count(clause, f"times?|{nouns}")
        if side in ("left", "right"):
            yield f"{name}_{side}", count
        elif side == "both":
            yield f"{name}_left", (1, _MANY)
            yield f"{name}_right", (1, _MANY)

    return rule


def _counted(name: str, nouns: str) -> Callable[[str], Iterator[tuple]]:
    return lambda clause: iter([(name, _count(clause, f"times?|{nouns}"))])


def _walk(clause: str):
    way = _way(clause)
    yield "direction", way  # None, too: who walks and then steps to the left does not go left on the whole
    if not way or not re.search(r"\bstep", clause):  # one step aside is not yet a walk
        yield "gait", "walk"


def _run(clause: str):
    way = _way(clause)
    yield "gait", "run"
    if way in ("left", "right"):
        yield "turned", way  # nobody runs sideways
    yield "direction", None if way in ("left", "right") else way


def _turn(clause: str):
    way = _way(clause)
    if way not in ("left", "right"):
        return
    yield "turned", way
    if re.search(r"\bfull\b|\ball the way\b|\b360\b", clause):
        yield f"turned_{way}", (270, 450)
    elif re.search(r"\bhalf\b|\baround\b|\b180\b", clause):
        yield f"turned_{way}", (120, 240)
    elif re.search(r"\bquarter\b|\b90\b", clause):
        yield f"turned_{way}", (50, 135)


def _circle(clause: str):
    yield "gait", "run" if re.search(r"\brun|\bjog", clause) else "walk"
    if (way := _way(clause)) in ("left", "right"):
        yield "turned", way
        yield f"turned_{way}", (200, _MANY)


def _raise(clause: str):
    if side := _limb(clause):
        yield "raised", side
        count = _count(clause, "times?")
        if count[1] == _MANY:
            yield "waving", "none"  # an arm raised several times is hard to tell from a great wave
        else:
            for each in ("left", "right") if side == "both" else (side,):
                yield f"raises_{each}", count


def _wave(clause: str):
    if side := _limb(clause):
        yield "raised", side
        yield "waving", side


def _lean(clause: str):
    if (way := _way(clause)) in ("left", "right"):
        yield f"leans_{way}", _count(clause)


def _pick(clause: str):
    if (side := _limb(clause)) in ("left", "right"):
        yield "low", side


def _jack(clause: str):
    for side in ("left", "right"):
        yield f"raises_{side}", _count(clause, "jumping jacks?")


def _jump(clause: str):
    yield "jumps", _count(clause, "times?|jumps?|leaps?")
    if way := _way(clause):
        yield "direction", way


def _march(clause: str):
    yield "gait", "still"
    low, high = _count(clause, "steps?")
    if high < _MANY:
        yield "knees_left", (low // 2, (high + 1) // 2)
        yield "knees_right", (low // 2, (high + 1) // 2)


def _point(clause: str):
    if (side := _limb(clause)) in ("left", "right"):
        yield "pointing", side


def _hop(clause: str):
    if _limb(clause) in ("left", "right"):
        yield from _sided("hops", "hops?")(clause)
    else:
        yield "jumps", _count(clause, "times?|hops?")
    if way := _way(clause):
        yield "direction", way


_RULES: dict[str, Callable[[str], Iterator[tuple]]] = {
    "jack": _jack,
    "circle": _circle,
    "swing": _sided("circles", "circles?"),
    "sit": _counted("sits", "times?"),
    "squat": _counted("squats", "squats?"),
    "bow": _counted("bows", "bows?"),
    "lean": _lean,
    "pick": _pick,
    "knee": _sided("knees", "times?"),
    "raise": _raise,
    "wave": _wave,
    "punch": _sided("punches", "punches|punch|jabs?"),
    "kick": _sided("kicks", "kicks?"),
    "clap": _counted("claps", "claps?"),
    "hop": _hop,
    "jump": _jump,
    "turn": _turn,
    "run": _run,
    "march": _march,
    "lunge": _sided("lunges", "lunges?"),
    "point": _point,
    "walk": _walk,
    "stand": lambda clause: iter([("gait", "still")]),
    "other": lambda clause: iter([]),
}
