"""Broken clips are told from sound ones: on clips of the demo grammar, and on real ones."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from planted import FAULTS

from motionary.archive.clip_measures import measured
from motionary.archive.flags import Told, flags
from motionary.corpus.demo import demo_clip
from motionary.formats.read import read_motion_with

CLIPS = int(os.environ.get("MOTIONARY_FLAG_CLIPS", "40"))  # `make flags` takes all 500
SEED = 20


def told(path: Path, joints: np.ndarray, fps: float, said: tuple[str, ...] = ()) -> Told:
    """What is known of joints once they went through a file."""
    np.save(path, joints.astype(np.float32))
    motion, reading = read_motion_with(path, fps=fps)
    return Told(".npy", reading.up, reading.unit, said, "", measured(motion))


@pytest.fixture(scope="module")
def sound(tmp_path_factory) -> list[Told]:
    """Twenty clips of the demo grammar."""
    path = tmp_path_factory.mktemp("sound") / "clip.npy"
    return [told(path, demo_clip(i, 1)[0].positions, 20.0, ("a person moves",)) for i in range(20)]


def test_the_demo_is_sound(sound):
    assert [own for own in flags(sound) if own] == []


EXPECTED = {
    "t-pose": "t-pose", "t-pose carried": "t-pose", "idle": "idle", "jitter": "jitter", "flip": "flip",
    "sides exchanged": "flip", "teleport": "jump", "spike": "jump", "slide": "sliding", "small": "scale",
    "large": "scale", "centimetres": "axes", "upside down": "axes", "z up": "axes",
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_called_by_its_name(sound, fault, tmp_path):
    joints = demo_clip(3, 1)[0].positions.astype(np.float64)
    broken = told(tmp_path / "clip.npy", FAULTS[fault](joints, np.random.default_rng(0), 20.0), 20.0)
    assert EXPECTED[fault] in flags([*sound, broken])[-1]


def test_standing_still_is_no_fault_where_a_caption_says_so(sound, tmp_path):
    joints = FAULTS["idle"](demo_clip(3, 1)[0].positions.astype(np.float64), np.random.default_rng(0), 20.0)
    joints += 0.03 * np.sin(np.arange(len(joints)) / 10)[:, None, None] * np.linspace(0, 1, 22)[:, None]
    said = told(tmp_path / "clip.npy", joints, 20.0, ("a person stands still",))
    unsaid = told(tmp_path / "clip.npy", joints, 20.0, ("a person waves",))
    assert "idle" not in flags([*sound, said])[-1]
    assert "idle" in flags([*sound, unsaid])[-1]


def test_several_people_of_another_size_are_no_fault(sound):
    """Children among adults: one is odd, a tenth of the folder is not."""
    child = Told(".npy", "y", 1.0, (), "", {**sound[0].measures, "size": 0.95})
    assert "scale" in flags([*sound, child])[-1]
    assert not any("scale" in own for own in flags([*sound, child, child, child]))


@pytest.mark.real
def test_faults_in_real_clips_are_found_and_sound_clips_are_left_alone(shared_data, tmp_path):
    """At least 95% of planted faults, at most 2% of sound clips, on others than those that set the limits."""
    sound, broken = [], []
    for number, (path, said) in enumerate(held_back(shared_data, CLIPS)):
        joints = np.load(path).astype(np.float64)[:1200]
        sound.append(told(tmp_path / "clip.npy", joints, 20.0, said))
        rng = np.random.default_rng([SEED, number])
        name = list(FAULTS)[number % len(FAULTS)]
        broken.append((name, told(tmp_path / "clip.npy", FAULTS[name](joints, rng, 20.0), 20.0, said)))
    wrong = [own for own in flags(sound) if own]
    missed = [name for name, one in broken if not flags([*sound, one])[-1]]
    print(f"{len(wrong)} of {len(sound)} sound clips flagged, {len(missed)} of {len(broken)} faults missed")
    assert len(wrong) <= max(2, 0.02 * len(sound)), wrong
    assert len(missed) <= max(2, 0.05 * len(broken)), missed


def held_back(data: Path, count: int) -> list[tuple[Path, tuple[str, ...]]]:
    """Clips of `cmu` and `styled` in equal parts, none of those on which the limits were set, and what is said."""
    found = []
    for folder in ("cmu", "styled"):
        lines = [json.loads(line) for line in (data / folder / "clips.jsonl").read_text().splitlines()]
        order = np.random.default_rng(1).permutation(len(lines))[850:]  # the first 850 set the limits
        for i in order[: count // 2]:
            said = (lines[i].get("action", ""), *(caption["text"] for caption in lines[i]["captions"]))
            found.append((data / folder / lines[i]["motion"], said))
    return found
