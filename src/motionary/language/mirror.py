"""The caption of a mirrored motion: left and right, clockwise and counterclockwise change places."""

from __future__ import annotations

import re

from motionary.language.lexicon import inflections

# Words that begin with a side: "left-handed" is left + "-handed", "rightmost" right + "most"; "bright" has no side.
_SIDE = re.compile(
    r"\b(left|right)(?=s?\b|wards?\b|wise\b|most\b|y\b|ies\b|hand|foot|side|leg|arm|turn|_)", re.IGNORECASE
)
_TURN = re.compile(r"\b(?:(counter|anti)[- ]?)?clock[- ]?wise\b", re.IGNORECASE)

# "right" that is no side. The rules read the same after mirroring, so that mirroring twice gives the text back.
_ALWAYS = re.compile(
    r"\b(?:"
    r"all[- ](?:left|right)\b"
    r"|(?:left|right)[- ](?:angle|angled|angles)\b"
    r"|(?:left|right)[- ]side[- ](?:up|down|out)\b"
    r"|(?:left|right) (?:now|away(?! from\b)|alone|handy)\b"
    r"|(?:is|are|was|were|gets?|got|be) (?:left|right) behind\b"  # a partner is left behind
    r"|(?:person|persons|people|man|woman|men|women|figure|human|he|she|they|who|has|have|had|having)"
    r" (?:left|right) (?:the|their|his|her|its|a|an) (?!left\b|right\b)\w+"  # the past of "leave"
    r")",
    re.IGNORECASE,
)
# "sits right after he jumps" means at once, but "turns right after he jumps" and "to the right after" mean the side.
_AT_ONCE = re.compile(
    r"(?P<before>[\w']+ )?\b(?:left|right) (?:after|before|when|as|at|in front|next to|beside|behind|there|here"
    r"|back(?! (?:foot|leg|hand|arm)\b)|around(?= *(?:$|[.,;!?]|and\b|then\b|again\b|to\b)))\b",
    re.IGNORECASE,
)
_DIRECTED = re.findall(  # verbs that take a side as adverb
    r"\w+",
    "turn step veer look lean bend hop sidestep shift swerve walk face rotate pivot move jump kick go run jog swing "
    "sway stagger stumble shuffle dodge leap slide dance stride skip spin twist tilt point reach strafe drift roll",
)
_BEFORE_A_SIDE = re.findall(
    r"\w+",
    "the a an his her their its my your to from and or then left right both with towards toward on other far slightly "
    "diagonally forward backward forwards backwards sharply quickly slowly hard",
)
_KEEPS_SIDE = {*_BEFORE_A_SIDE, *_DIRECTED, *(form for verb in _DIRECTED for form in inflections(verb))}


def mirror_text(text: str) -> str:
    """Swap the sides in a caption; case, punctuation and everything else stay.

    Idioms keep their word ("right after", "all right", "right angle", "he left the room"). Mirroring twice returns
    the text, except that every spelling of counterclockwise comes back as "counterclockwise".
    """
    kept = [match.span() for match in _ALWAYS.finditer(text)]
    kept += [match.span() for match in _AT_ONCE.finditer(text) if _is_idiom(match)]

    def swap_side(match: re.Match[str]) -> str:
        """The other side, unless the word belongs to an idiom."""
        if any(start <= match.start() < end for start, end in kept):
            return match[0]
        return _with_case("right" if match[1].lower() == "left" else "left", match[1])

    # Sides first: the spans belong to the text as it came, and turning words hold no side.
    return _TURN.sub(_swap_turn, _SIDE.sub(swap_side, text))


def _is_idiom(match: re.Match[str]) -> bool:
    before = (match["before"] or "").strip().lower()
    return before not in _KEEPS_SIDE or (before.startswith("turn") and match[0].lower().endswith("around"))


def _swap_turn(match: re.Match[str]) -> str:
    return _with_case("clockwise" if match[1] else "counterclockwise", match[0])


def _with_case(word: str, like: str) -> str:
    if like.isupper():
        return word.upper()
    return word.capitalize() if like[0].isupper() else word
