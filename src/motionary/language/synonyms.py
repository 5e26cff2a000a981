"""Words that mean much the same to a body, where a sentence model alone is a poor judge of single words."""

from __future__ import annotations

from collections.abc import Callable

# MiniLM puts "hurl" next to "hunch" and "table" next to "row". Of each row the first word that a corpus has stands for
# the others; a reader is told so, as of any replaced word.
_ROWS = (
    *("throw toss hurl fling lob chuck", "walk stroll saunter amble wander stride march promenade"),
    *("run jog sprint dash race gallop", "jump leap hop bounce", "fall collapse faint tumble topple"),
    *("sneak creep tiptoe prowl", "chair seat stool sofa couch bench armchair", "box parcel package crate container"),
    *("table desk counter surface", "dance waltz tango twirl boogie groove ballet", "fight spar brawl box punch"),
    *("hug embrace cuddle", "push shove", "pull drag tug haul", "lift raise hoist elevate", "limp hobble"),
    *("stumble stagger trip", "wave greet beckon", "clap applaud", "bow curtsey", "kneel genuflect"),
    *("pick grab take fetch", "crawl creep slither", "spin twirl pirouette turn", "swim paddle", "hit strike smash"),
    *("stab thrust punch", "look gaze stare glance", "think ponder", "cry weep sob", "laugh smile giggle grin"),
    *("sad sadly gloomy depressed unhappy miserable", "angry angrily furious mad", "tired exhausted weary"),
    *("happy happily cheerful joyful joyfully glad", "scared afraid fearful frightened", "drunk tipsy drunken"),
    *("quickly fast swiftly rapidly hastily hurriedly quick swift", "slowly slow leisurely", "elegantly elegant"),
    *("backwards backward", "forward forwards ahead", "home back", "phone telephone smartphone", "salute wave"),
    *("robot robotic robotically", "ninja martial karate"),
)
_OF_WORD: dict[str, list[tuple[str, ...]]] = {}
for _row in map(str.split, _ROWS):
    for _word in _row:
        _OF_WORD.setdefault(_word, []).append(tuple(_row))


def synonym(word: str, known: Callable[[str], bool]) -> str | None:
    """The first known word that stands in a row with an unknown lemma; None where none does."""
    return next((other for row in _OF_WORD.get(word, []) for other in row if other != word and known(other)), None)
