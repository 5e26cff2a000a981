"""Prompts that tell of several motions are told from those that tell of one."""

from __future__ import annotations

import pytest

from motionary.language import prompt_parts


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("a person walks forward then waves", ("a person walks forward", "waves")),
        ("a person walks forward, and then sits down", ("a person walks forward", "sits down")),
        ("he jumps before sitting down", ("he jumps", "sitting down")),
        ("she kneels. Afterwards, she stands up.", ("she kneels", "she stands up")),
        ("walks, then turns, then runs", ("walks", "turns", "runs")),
        ("a man bows followed by a jump", ("a man bows", "a jump")),
    ],
)
def test_parts_that_follow_each_other_are_told_apart(text, parts):
    assert prompt_parts(text) == parts


@pytest.mark.parametrize(
    "text",
    [
        "walks and turns right", "a person sits down and stands up again", "then waves", "after jumping he sits", "",
        "a person stands before a table", "a person walks forward, then backwards", "a person claps while walking",
    ],
)  # fmt: skip
def test_one_motion_is_one_part(text):
    assert prompt_parts(text) == (text,)
