"""`expected`: what a caption claims about a motion, in the oracle's own words."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

from motionary.oracle.phrases import MANY, clauses, count_in, limb_in, way_in

Claims = dict[str, str | tuple[float, float]]  # attribute -> word, or closed interval


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
    for verb, clause in clauses(text):
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


def _sided(name: str, nouns: str) -> Callable[[str], Iterator[tuple]]:
    """Counts of a limb: of the named side exactly; where no side is named, nothing can be claimed of either."""

    def rule(clause: str):
        """Claims of one clause."""
        side, count = limb_in(clause), count_in(clause, f"times?|{nouns}")
        if side in ("left", "right"):
            yield f"{name}_{side}", count
        elif side == "both":
            yield f"{name}_left", (1, MANY)
            yield f"{name}_right", (1, MANY)

    return rule


def _counted(name: str, nouns: str) -> Callable[[str], Iterator[tuple]]:
    return lambda clause: iter([(name, count_in(clause, f"times?|{nouns}"))])


def _walk(clause: str):
    way = way_in(clause)
    yield "direction", way  # None, too: who walks and then steps to the left does not go left on the whole
    if not way or not re.search(r"\bstep", clause):  # one step aside is not yet a walk
        yield "gait", "walk"


def _run(clause: str):
    way = way_in(clause)
    yield "gait", "run"
    if way in ("left", "right"):
        yield "turned", way  # nobody runs sideways
    yield "direction", None if way in ("left", "right") else way


def _turn(clause: str):
    way = way_in(clause)
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
    if (way := way_in(clause)) in ("left", "right"):
        yield "turned", way
        yield f"turned_{way}", (200, MANY)


def _raise(clause: str):
    if side := limb_in(clause):
        yield "raised", side
        count = count_in(clause, "times?")
        if count[1] == MANY:
            yield "waving", "none"  # an arm raised several times is hard to tell from a great wave
        else:
            for each in ("left", "right") if side == "both" else (side,):
                yield f"raises_{each}", count


def _wave(clause: str):
    if side := limb_in(clause):
        yield "raised", side
        yield "waving", side


def _lean(clause: str):
    if (way := way_in(clause)) in ("left", "right"):
        yield f"leans_{way}", count_in(clause)


def _pick(clause: str):
    if (side := limb_in(clause)) in ("left", "right"):
        yield "low", side


def _jack(clause: str):
    for side in ("left", "right"):
        yield f"raises_{side}", count_in(clause, "jumping jacks?")


def _jump(clause: str):
    yield "jumps", count_in(clause, "times?|jumps?|leaps?")
    if way := way_in(clause):
        yield "direction", way


def _march(clause: str):
    yield "gait", "still"
    low, high = count_in(clause, "steps?")
    if high < MANY:
        yield "knees_left", (low // 2, (high + 1) // 2)
        yield "knees_right", (low // 2, (high + 1) // 2)


def _point(clause: str):
    if (side := limb_in(clause)) in ("left", "right"):
        yield "pointing", side


def _hop(clause: str):
    if limb_in(clause) in ("left", "right"):
        yield from _sided("hops", "hops?")(clause)
    else:
        yield "jumps", count_in(clause, "times?|hops?")
    if way := way_in(clause):
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
