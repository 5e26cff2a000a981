"""English captions of a clip: a small, consistent vocabulary in varied sentences, always telling the whole truth.

Every caption names the action, the side or direction, the count, the speed and the style, where the clip has them.
"""

from __future__ import annotations

import numpy as np

from motionary.corpus.demo.acts import Act

LONGEST = 20  # words; longer sentences are drawn again
SUBJECTS = ("a person", "someone", "the person", "a man", "a woman")
COUNTS = {1: ("once",), 2: ("twice", "two times"), 3: ("three times",), 4: ("four times",), 5: ("five times",)}
NUMBERS = {1: "one", 2: "two", 3: "three", 4: "four", 5: "five", 6: "six"}
SPEEDS = {"slow": ("slowly",), "fast": ("quickly", "fast")}
STYLE_PHRASES = {
    "happy": ("happily", "in a happy way", "like a happy person"),
    "tired": ("tiredly", "in a tired way", "like a tired person"),
    "old": ("in an old way", "like an old person"),
    "angry": ("angrily", "in an angry way", "like an angry person"),
    "proud": ("proudly", "in a proud way", "like a proud person"),
}
DIRECTIONS = {
    "forward": ("forward", "forwards"),
    "backward": ("backward", "backwards"),
    "left": ("to the left",),
    "right": ("to the right",),
    "up": ("up",),
    "side": ("to the side",),
}

# Verb phrases by action. {side}, {dir} and {bare} (to the left, left), {n} (once, twice, ...), {num} (one, two, ...)
# and {s} (plural) are filled in.
PHRASES: dict[str, tuple[str, ...]] = {
    "run": ("runs {dir}", "jogs {dir}"),
    "circle": ("walks in a circle {dir}", "walks around in a circle {dir}"),
    "sidestep": ("steps {dir} {n}", "takes {num} step{s} {dir}", "steps sideways {dir} {n}"),
    "march": ("marches in place for {num} steps", "marches on the spot for {num} steps"),
    "knee": ("lifts the {side} knee {n}", "raises the {side} knee {n}"),
    "jump": ("jumps {dir} {n}", "jumps {dir} with both feet {n}"),
    "hop": ("hops {dir} on the {side} foot {n}", "hops {dir} on the {side} leg {n}"),
    "jack": ("does {num} jumping jacks", "performs {num} jumping jacks"),
    "squat": ("squats {n}", "does {num} squat{s}", "squats down {n}"),
    "sit": ("sits down and stands up again", "sits down on a chair and stands up"),
    "bow": ("bows {n}", "bows forward {n}"),
    "lean": ("bends {dir} {n}", "leans {dir} {n}"),
    "lunge": ("lunges forward with the {side} leg {n}", "does {num} lunge{s} with the {side} leg"),
    "pick": ("picks something up with the {side} hand", "picks up something from the floor with the {side} hand"),
    "stand": ("stands still", "stands in place", "stands still and does nothing"),
    "clap": ("claps {n}", "claps the hands {n}"),
    "throw": ("throws something with the {side} hand {n}", "throws a ball with the {side} hand {n}"),
}
_SIDED: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {  # (one side, both sides)
    "wave": (
        ("waves with the {side} hand", "waves the {side} hand", "waves the {side} arm"),
        ("waves with both hands", "waves both hands", "waves both arms"),
    ),
    "raise": (
        ("raises the {side} arm {n}", "raises the {side} hand {n}", "lifts the {side} arm up {n}"),
        ("raises both arms {n}", "raises both hands {n}", "lifts both arms up {n}"),
    ),
    "punch": (
        ("punches with the {side} hand {n}", "punches forward with the {side} fist {n}"),
        ("punches with both hands {n}", "punches forward with both fists {n}"),
    ),
    "swing": (
        ("swings the {side} arm in circles {dir} {n}", "circles the {side} arm {dir} {n}"),
        ("swings both arms in circles {dir} {n}", "circles both arms {dir} {n}"),
    ),
}
_GERUNDS = {
    "waves": "waving",
    "raises": "raising",
    "lifts": "lifting",
    "claps": "clapping",
    "points": "pointing",
}
# Words that name an action in a caption (lemmas), for scoring.
ACTION_WORDS: dict[str, tuple[tuple[str, ...], ...]] = {
    "walk": (("walk",),),
    "run": (("run",), ("jog",)),
    "circle": (("walk", "circle"),),
    "turn": (("turn",),),
    "sidestep": (("step",),),
    "march": (("march",),),
    "knee": (("knee",),),
    "jump": (("jump",),),
    "hop": (("hop",),),
    "jack": (("jack",), ("jacks",)),
    "squat": (("squat",),),
    "sit": (("sit",),),
    "bow": (("bow",),),
    "lean": (("bend",), ("lean",)),
    "lunge": (("lunge",),),
    "pick": (("pick",),),
    "kick": (("kick",),),
    "stand": (("stand", "still"), ("stand", "place"), ("stand", "nothing")),
    "wave": (("wave",),),
    "raise": (("raise", "arm"), ("raise", "hand"), ("lift", "arm")),
    "punch": (("punch",),),
    "clap": (("clap",),),
    "point": (("point",),),
    "throw": (("throw",),),
    "swing": (("swing", "arm"), ("circle", "arm")),
}


def _phrases(act: Act) -> tuple[str, ...]:
    if act.action in _SIDED:
        return _SIDED[act.action][act.side == "both"]
    if act.action == "walk":
        if not act.turn:
            return ("walks {dir}",)
        return ("walks in a curve {dir}", "walks forward and curves {dir}", "walks and turns {bare}")
    if act.action == "turn":
        return {
            "quarter": ("turns {dir}", "turns {bare}", "makes a quarter turn {dir}"),
            "half": ("turns around {dir}", "makes a half turn {dir}"),
            "full": ("makes a full turn {dir}", "turns all the way around {dir}"),
        }[act.angle or "half"]
    if act.action == "kick":
        if act.direction == "side":
            return ("kicks to the side with the {side} foot {n}", "kicks sideways with the {side} leg {n}")
        return ("kicks forward with the {side} foot {n}", "kicks forward with the {side} leg {n}")
    if act.action == "point":
        if act.direction == "side":
            return ("points to the {side} with the {side} hand", "points to the side with the {side} arm")
        return ("points forward with the {side} hand", "points ahead with the {side} arm")
    return PHRASES[act.action]


def _pick(rng: np.random.Generator, values: tuple[str, ...]) -> str:
    return values[int(rng.integers(len(values)))]


def phrase(act: Act, rng: np.random.Generator) -> str:
    """A verb phrase in the third person for one act, without speed or style."""
    count = act.times
    text = _pick(rng, _phrases(act)).format(
        side=act.side,
        dir=_pick(rng, DIRECTIONS[act.direction]) if act.direction else "",
        bare=act.direction,
        n=_pick(rng, COUNTS.get(count, ("",))) if act.count else "",
        num=NUMBERS[count],
        s="" if count == 1 else "s",
    )
    return " ".join(text.split())


def _gerund(text: str) -> str:
    verb, _, rest = text.partition(" ")
    return f"{_GERUNDS[verb]} {rest}"


def _sentence(acts: tuple[Act, ...], style: str, together: bool, rng: np.random.Generator) -> str:
    phrases = [phrase(act, rng) for act in acts]
    if len(phrases) == 1:
        body = phrases[0]
    elif together:
        body = f"{phrases[0]} while {_gerund(phrases[1])}"
    else:
        body = f"{phrases[0]} {_pick(rng, ('then', 'and then', 'and'))} {phrases[1]}"
    manner = SPEEDS.get(acts[0].speed or "") or STYLE_PHRASES.get(style, ("",))
    word = _pick(rng, manner)
    subject = _pick(rng, SUBJECTS)
    if word.endswith("ly") and rng.random() < 0.4:
        return f"{subject} {word} {body}"
    if word and len(phrases) > 1 and not together:
        # Behind two acts a manner would seem to belong to the second alone.
        return f"{'an' if style[0] in 'ao' else 'a'} {style} person {body}"
    return f"{subject} {body} {word}".strip()


def captions(
    acts: tuple[Act, ...], style: str, together: bool, rng: np.random.Generator, count: int | None = None
) -> list[str]:
    """Three or four different sentences that tell a clip's whole truth.

    Args:
        acts: one act or two.
        style: a key of `styles.STYLES`.
        together: the second act happens during the first.
        rng: draws templates and synonyms.
        count: how many (default three or four).
    """
    wanted = count or int(rng.integers(3, 5))
    found: dict[str, None] = {}
    for _ in range(60):
        sentence = _sentence(acts, style, together, rng)
        if len(sentence.split()) > LONGEST:
            continue
        found[sentence] = None
        if len(found) == wanted:
            break
    return list(found)


def names_action(words: set[str] | list[str] | tuple[str, ...], action: str) -> bool:
    """Whether lemmatized words name an action label of the demo corpus."""
    have = set(words)
    return any(have.issuperset(group) for group in ACTION_WORDS[action])
