"""Poses of what is shown: by number and second, and what is wrong in one line."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.app.player import Item
from motionary.app.shown_poses import read_poses
from motionary.corpus.demo import demo_clip
from motionary.errors import InputError


@pytest.fixture(scope="module")
def items() -> list[Item]:
    return [Item(demo_clip(i)[0], str(i), "a person walks") for i in range(2)]


def test_poses_are_frames_of_what_is_shown(items):
    found = read_poses("0=2, 2.5=1@0.5", items)
    assert list(found) == [0.0, 2.5]
    np.testing.assert_array_equal(found[0.0].positions, items[1].motion.positions[:1])
    frame = round(0.5 * items[0].motion.fps)
    np.testing.assert_array_equal(found[2.5].positions, items[0].motion.positions[frame : frame + 1])
    assert read_poses("  ", items) == {}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("2", "must be like 2=1@0.5"),
        ("-1=1", "must be like"),
        ("nan=1", "must be like"),
        ("1=0", "motions on show: 2"),
        ("1=3", "motions on show: 2"),
        ("1=1@99", "motion 1 lasts"),
        ("1=1 1=2", "another pose has"),
        (" ".join(f"{i}=1" for i in range(11)), "at most 10"),
    ],
)
def test_what_is_wrong_is_one_line(items, text, message):
    with pytest.raises(InputError, match=message):
        read_poses(text, items)


def test_nothing_on_show_has_no_poses():
    with pytest.raises(InputError, match="motions on show: 0"):
        read_poses("0=1", [])
