"""What a visitor sees without asking, and what works on what is shown; over a real connection."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from tiny import add_stylizers, add_temos
from visitor import Visitor

from motionary.app import server
from motionary.app.opening import Opening
from motionary.app.wording import file_name, plain, titles
from motionary.corpus.demo import demo_clip
from motionary.motion import Motion
from motionary.systems.registry import SYSTEMS


@pytest.fixture(scope="module")
def app(pipeline, tmp_path_factory):
    root = shutil.copytree(pipeline, tmp_path_factory.mktemp("app") / "project")
    add_stylizers(root, root / "models")
    add_temos(root, root / "models")
    app = server.App(root / "models", "cpu", "127.0.0.1", 0)
    yield app
    app.close()


@pytest.fixture
def visitor(app):
    visitor = Visitor(app.url)
    visitor.says("Captioned")  # the first motion plays, and has been read
    visitor.texts.clear()
    yield visitor
    visitor.close()


def shown(app: server.App) -> list[Motion]:
    """What the newest visitor sees."""
    return [item.motion for item in app._panels[max(app._panels)].player.items]


def test_a_motion_plays_before_anything_is_asked_and_three_sentences_are_there_to_try(app, visitor):
    (first,) = shown(app)
    assert app._panels[max(app._panels)].player.playing
    prompts = app.opening.prompts
    assert 1 <= len(prompts) <= 3
    assert not any(app.dictionary.reading(prompt).line for prompt in prompts)  # every word is known
    visitor.ask("Try", prompts[-1])
    visitor.says("Read as: ")
    assert shown(app)[0] is not first


def test_enter_asks(app, visitor):
    visitor.ask("Variants", 2)
    visitor.ask("Prompt", "a person walks")
    visitor.enter()
    visitor.says("Read as: a person walk")
    assert [item.title for item in app._panels[max(app._panels)].player.items] == ["1", "2"]
    visitor.says("1\\. a person walks**", "Captioned:")


def test_a_motion_goes_on_with_what_follows_and_goes_along_a_path(app, visitor):
    visitor.ask("Prompt", "a person walks")
    visitor.ask("Then", "a person jumps; a person <b>walks;")
    visitor.ask("Seconds", 1.0)
    visitor.enter()
    visitor.says("Read as: a person walk", "Read as: a person jump")
    (motion,) = shown(app)
    assert motion.duration > 2.5  # three seconds but for what the seams take
    assert (
        app._panels[max(app._panels)].player.items[0].said
        == "a person walks, then a person jumps, then a person <b>walks"
    )
    visitor.ask("Then", "")
    visitor.ask("Path", "0,0 0,1 1,1")
    visitor.texts.clear()
    visitor.enter()
    visitor.says("Read as: a person walk")
    ground = shown(app)[0].positions[:, 0, [0, 2]]
    assert np.abs(ground[-1] - ground[0] - [1, 1]).max() < 0.1
    visitor.ask("Loop", True)
    visitor.enter()
    visitor.until(lambda: visitor.notes, "a refusal")
    assert "contradict each other" in visitor.notes[-1]
    visitor.ask("Loop", False)
    visitor.ask("Path", "0,0 north")
    visitor.enter()
    visitor.until(lambda: len(visitor.notes) > 1, "another refusal")
    assert "must be points x,z" in visitor.notes[-1]


def test_a_motion_goes_through_poses_of_what_is_shown(app, visitor):
    visitor.ask("Prompt", "a person walks")
    visitor.ask("Seconds", 2.0)
    visitor.enter()
    visitor.says("Read as: a person walk")
    before = shown(app)[0]
    visitor.ask("Prompt", "a person jumps")
    visitor.ask("Poses", "1=1@0.5")
    visitor.texts.clear()
    visitor.enter()
    visitor.says("Read as: a person jump")
    after = shown(app)[0]
    frames = round(after.fps), round(0.5 * before.fps)
    made, asked = after.positions[frames[0]], before.positions[frames[1]]
    assert np.abs(made[0, [0, 2]] - asked[0, [0, 2]]).max() < 0.01
    # Two motions have bones of their own lengths, so the pose is the same in directions.
    parents = list(after.skeleton.parents[1:])
    bones = [pose[1:] - pose[parents] for pose in (made, asked)]
    first, second = (bone / np.linalg.norm(bone, axis=-1, keepdims=True) for bone in bones)
    assert (first * second).sum(-1).min() > 0.98
    visitor.ask("Poses", "1=4")
    visitor.enter()
    visitor.until(lambda: visitor.notes, "a refusal")
    assert "motions on show: 1" in visitor.notes[-1]


def test_styles_go_on_from_what_is_shown_and_not_from_the_last_upload(app, visitor, tmp_path):
    walk = demo_clip(3)[0]
    walk.save(tmp_path / "walk.npz")
    visitor.upload("Upload a motion (BVH, NPZ)", "walk.npz", (tmp_path / "walk.npz").read_bytes())
    visitor.says("walk.npz: ")
    visitor.ask("Variants", 2)
    visitor.ask("Prompt", "a person waves with the left hand")
    visitor.ask("Generate")
    visitor.says("Read as: ")
    made = shown(app)
    visitor.ask("Motion to restyle", "2. a person waves with the left hand")
    visitor.ask("Stylize")
    visitor.says("Stylized: by chance")
    before, after = shown(app)
    assert before is made[1]
    assert abs(after.frames - before.frames) <= 4
    visitor.ask("Stylize")  # the same again, not the styled one
    visitor.until(lambda: sum("Stylized" in text for text in visitor.texts) == 2, "the second")
    assert shown(app)[0] is made[1]


def test_a_part_is_made_anew_and_the_motion_goes_on(app, visitor):
    (first,) = shown(app)
    visitor.ask("From second", 0.4)
    visitor.ask("To second", 0.8)
    visitor.ask("Change this part")
    visitor.says("Edited: ", "from 0.4 to 0.8 s a person jumps")
    before, after = shown(app)
    assert before is first
    assert after.frames == before.frames
    assert np.abs(after.positions - before.positions).max() > 0
    visitor.ask("To second", 0.2)
    visitor.ask("Change this part")
    visitor.until(lambda: visitor.notes, "a refusal")
    assert "must be the beginning and the end of a part" in visitor.notes[0]
    visitor.ask("Seconds more", 1.0)
    visitor.ask("Go on")
    visitor.says("Edited: ", ", then a person jumps")
    assert shown(app)[1].duration > before.duration + 0.5


def test_sentences_are_blended(app, visitor):
    visitor.ask("From", "a person walks")
    visitor.ask("To", "a person <b>jumps")
    visitor.ask("Steps", 3)
    visitor.ask("Blend")
    visitor.says("From: a person walks", "\\<b\\>jumps")
    items = app._panels[max(app._panels)].player.items
    assert [item.title for item in items] == ["0%", "50%", "100%"]
    (half,) = {item.motion.frames for item in items}
    expected = app.dictionary.blend("a person walks", "a person <b>jumps", 3, 4.0, 0)
    assert all(np.allclose(item.motion.positions, m.positions) for item, m in zip(items, expected, strict=True)), half


def test_what_is_shown_is_described_by_consensus(app, visitor):
    visitor.ask("Sentences", 2)
    visitor.ask("Consensus of", 10)
    visitor.ask("Describe")
    visitor.says("**Captions** of")
    (motion,) = shown(app)
    said = next(text for text in visitor.texts if "**Captions**" in text)
    assert [plain(text) for text in app.dictionary.caption(motion, 2, consensus=10)] == said.split("\n\n")[1].replace(
        "- ", ""
    ).split("\n")


def test_sentences_come_first_whose_motion_is_read_as_they_say(app, monkeypatch):
    monkeypatch.setattr(app.dictionary, "caption", lambda motion: ["the person is walking slowly"])
    opening = Opening(app.dictionary, app.opening._generators)
    (first,) = opening.items()
    assert first.said == opening.prompts[0]
    assert "walks" in first.said
    assert len(opening.prompts) == len(app.opening.prompts)


def test_models_that_make_nothing_open_with_nothing(app, capsys):
    opening = Opening(app.dictionary, ())
    assert opening.items() == ()
    broken = Opening(app.dictionary, ("no such system",))
    assert broken.items() == ()
    assert "no such system" in capsys.readouterr().err


def test_no_text_becomes_markdown_or_html():
    hostile = "<script>alert(1)</script> [x](javascript:1) **b** `c` <unknown> &lt; $x$ ~~y~~ | # \\"
    shown = plain(hostile)
    for sign in "<>[]()*`&$~|#":
        assert f"\\{sign}" in shown
        assert shown.count(sign) == shown.count(f"\\{sign}")
    assert plain("1. first\n- second") == "1\\. first \\- second"


def test_titles_tell_motions_apart():
    assert titles(["a person walks"]) == ["a person walks"]
    assert titles(["a"] * 3) == ["1", "2", "3"]
    several = titles(["a person walks in a circle", "a person jumps"])
    assert several == ["1. a person walks in...", "2. a person jumps"]
    assert len(titles(["x" * 200])[0]) < 50
    assert file_name("A person, <waves>!") == "a-person-waves"
    assert file_name("你好") == "motion"


@pytest.mark.parametrize("system", SYSTEMS, ids=lambda system: system.name)
def test_every_system_has_a_sentence(system):
    assert system.about.endswith(".")
    assert system.about[0].isupper()
    assert 20 < len(system.about) < 110
