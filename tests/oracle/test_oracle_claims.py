"""What captions claim, and the oracle on labeled clips: real ones and those of the demo corpus."""

import hashlib
import json

import numpy as np
import pytest

from motionary.corpus.demo import demo_clip
from motionary.errors import InputError
from motionary.motion import Motion, Skeleton
from motionary.oracle import DEFAULT, PROMPTS, confirm, expected, failures, fit_thresholds, read

MANY = float("inf")


@pytest.mark.parametrize(
    ("text", "claims"),
    [
        ("A person raises the left hand.", {"raised": "left", "waving": "none"}),
        ("a man lifts his right arm twice", {"raised": "right", "raises_right": (2, 2)}),
        ("someone is waving both arms in the air", {"raised": "both", "waving": "both"}),
        ("raise-up-both-hands", {"raised": "both", "waving": "none"}),
        ("a person waves", None),
        ("a person walks forward and turns left", {"gait": "walk", "direction": "forward", "turned": "left"}),
        ("a person takes a walk", {"gait": "walk"}),
        ("walk-back", {"gait": "walk", "direction": "backward"}),
        ("she walks sideways to her right", {"gait": "walk", "direction": "right"}),
        ("he walks back and forth", {"gait": "walk"}),
        ("a person sprints ahead angrily", {"gait": "run", "direction": "forward"}),
        ("a woman runs to the left", {"gait": "run", "turned": "left"}),
        ("someone jumps up three times", {"jumps": (3, 3)}),
        ("a man jumps once and then jumps to the left twice", {"jumps": (3, 3), "direction": "left"}),
        ("a person makes a half turn to the right", {"turned": "right", "turned_right": (120, 240)}),
        ("she hops forward on the left foot", {"hops_left": (1, MANY), "direction": "forward"}),
        ("a man kicks with the left leg twice then squats", {"kicks_left": (2, 2), "squats": (1, MANY)}),
        ("someone claps and does two lunges with the right leg", {"claps": (1, MANY), "lunges_right": (2, 2)}),
        ("a person marches in place for six steps", {"gait": "still", "knees_left": (3, 3), "knees_right": (3, 3)}),
        ("a person walks forward, then steps to the left once", {"gait": "walk"}),
        ("a person is sad", None),
        ("", None),
    ],
)
def test_captions_claim_what_they_say(text, claims):
    assert expected(text) == claims


def test_prompts_claim_what_their_texts_say():
    for prompt in PROMPTS:
        assert expected(prompt.text) == prompt.claims, prompt.text
    assert len({p.text for p in PROMPTS}) == len(PROMPTS)


def styled(folder, test):
    """Clips of the prompts' actions, split 80/20 by a hash of their names: (motion, action)."""
    rows = [json.loads(line) for line in (folder / "clips.jsonl").read_text().splitlines()]
    rows.sort(key=lambda row: hashlib.sha256(row["motion"].encode()).hexdigest())
    cut = int(0.8 * len(rows))
    actions, smpl = {p.action for p in PROMPTS}, Skeleton.named("smpl22")
    for row in rows[cut:] if test else rows[:cut]:
        if row["action"] in actions:
            yield Motion(np.load(folder / row["motion"]).astype(np.float32), row["fps"], smpl), row["action"]


@pytest.mark.real
def test_real_test_clips_are_read_right(shared_data):
    right: dict[str, list[bool]] = {}
    for motion, action in styled(shared_data / "styled", test=True):
        prompt = next(p for p in PROMPTS if p.action == action)
        right.setdefault(action, []).append(confirm(motion, prompt) is True)
    assert set(right) == {p.action for p in PROMPTS}
    assert np.mean(sum(right.values(), [])) >= 0.98  # noqa: RUF017 (fourteen short lists)
    for action, answers in right.items():
        assert np.mean(answers) >= 0.95, action


@pytest.mark.real
def test_stored_thresholds_are_those_of_the_training_clips(shared_data):
    motions, actions = zip(*styled(shared_data / "styled", test=False), strict=True)
    fitted = fit_thresholds(motions, actions)
    for name, value in vars(DEFAULT).items():
        assert getattr(fitted, name) == pytest.approx(value, rel=0.02), name


@pytest.fixture(scope="module")
def demo():
    return [demo_clip(index, seed=5) for index in range(200)]


def test_demo_captions_are_confirmed_by_their_motions_and_not_by_others(demo):
    thresholds = fit_thresholds([m for m, _ in demo[:120]], [truth["captions"][0] for _, truth in demo[:120]])
    attributes = [read(motion, thresholds) for motion, _ in demo[120:]]
    claims = [[expected(text) for text in truth["captions"]] for _, truth in demo[120:]]
    own = [not failures(a, c) for a, texts in zip(attributes, claims, strict=True) for c in texts if c]
    others = [not failures(a, c[0]) for a, c in zip(attributes, claims[1:] + claims[:1], strict=True) if c[0]]
    assert np.mean(own) >= 0.95
    assert np.mean(others) <= 0.15
    assert np.mean([c is not None for texts in claims for c in texts]) >= 0.85


def test_thresholds_without_examples_stay(demo):
    assert fit_thresholds([demo[0][0]], ["a person thinks"]) == DEFAULT
    with pytest.raises(InputError):
        fit_thresholds([demo[0][0]], [])
