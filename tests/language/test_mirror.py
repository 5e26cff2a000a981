"""Mirrored captions: sides swap, idioms stay, and twice is as good as not at all."""

import json

import pytest

from motionary.language import mirror_text

PAIRS = [
    ("a person raises the left arm", "a person raises the right arm"),
    ("Left, then RIGHT.", "Right, then LEFT."),
    ("left-handed, leftwards, leftmost", "right-handed, rightwards, rightmost"),
    ("a lefty on the lefthand side", "a righty on the righthand side"),
    ("from left to right/left", "from right to left/right"),
    ("turns clockwise", "turns counterclockwise"),
    ("Clockwise", "Counterclockwise"),
    ("to the right after the jump", "to the left after the jump"),
    ("turns right before the wall", "turns left before the wall"),
    ("runs left and then right around an obstacle", "runs right and then left around an obstacle"),
    ("he holds the left back foot", "he holds the right back foot"),
    ("steps right away from the wall", "steps left away from the wall"),
]
FIXED = [
    "stands right after he sits",
    "all right, he goes right away",
    "turns right around.",
    "sits upright and brightly copyrighted",
    "at a right angle",
    "he sits right there",
    "the man left the room",
    "a person walks",
    "",
]


@pytest.mark.parametrize(("text", "mirrored"), PAIRS)
def test_sides_swap_both_ways(text, mirrored):
    assert mirror_text(text) == mirrored
    assert mirror_text(mirrored) == text


@pytest.mark.parametrize("text", FIXED)
def test_what_is_no_side_stays(text):
    assert mirror_text(text) == text


@pytest.mark.parametrize("spelling", ["anticlockwise", "anti-clockwise", "counter-clockwise", "counter clockwise"])
def test_every_spelling_of_counterclockwise_turns(spelling):
    assert mirror_text(f"spins {spelling} once") == "spins clockwise once"


@pytest.mark.real
def test_real_captions_mirror_twice_to_themselves(shared_data):
    for name in ("captioned", "styled"):
        for line in (shared_data / name / "clips.jsonl").read_text(encoding="utf-8").splitlines():
            for caption in json.loads(line).get("captions", []):
                text = caption["text"]
                assert mirror_text(mirror_text(text)) == text
                sided = any(word in text.lower() for word in ("left", "right", "clockwise"))
                assert (mirror_text(text) != text) == sided
