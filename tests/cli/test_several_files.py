"""What users know of their files, on every verb that reads; and several files, of which some are bad."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from shell import call
from tiny import add_stylizers

from motionary import read_motion
from motionary.cli import options as shared
from motionary.cli.command import build_parser
from motionary.cli.commands import COMMANDS
from motionary.cli.stylize import _names
from motionary.corpus.demo import demo_clip
from motionary.motion import Motion, Skeleton

READERS = ("caption", "stylize", "convert", "view")
FLAGS = [("--up=-y", {"up": "-y"}), ("--unit=dm", {"unit": "dm"}), ("--mirror", {"mirror": True})]
FLAGS += [("--no-mirror", {"mirror": False}), ("--skip-first", {"skip_first": True})]


@pytest.fixture
def stylers(pipeline, tmp_path) -> list[str]:
    """The same models and untrained stylizers."""
    shutil.copytree(pipeline / "models", tmp_path / "models")
    add_stylizers(pipeline, tmp_path / "models")
    return ["--models", str(tmp_path / "models"), "--device", "cpu"]


@pytest.mark.parametrize("verb", READERS)
@pytest.mark.parametrize(("flag", "told"), FLAGS)
def test_every_verb_reads_as_it_is_told(clip, verb, flag, told):
    """Each verb's own parser takes the flag, and what it reads is what Python reads with the same words."""
    second = ["out.npz"] if verb == "convert" else []
    options = build_parser(COMMANDS).parse_args([verb, str(clip), *second, flag])
    assert {name: shared.reading(options)[name] for name in told} == told
    wanted, plain = read_motion(clip, **told), read_motion(clip)
    assert (
        wanted.frames != plain.frames or told == {"mirror": False} or not np.allclose(wanted.positions, plain.positions)
    )
    if verb != "convert":
        (found,) = shared.read_files(options).values()
        np.testing.assert_array_equal(found.positions, wanted.positions)


@pytest.mark.parametrize(("flag", "told"), FLAGS)
def test_convert_and_view_write_what_they_were_told(clip, tmp_path, capsys, flag, told):
    target, page, other = tmp_path / "out.npz", tmp_path / "told.html", tmp_path / "wanted.html"
    assert call(capsys, "convert", str(clip), str(target), flag)[0] == 0
    wanted = read_motion(clip, **told)
    np.testing.assert_allclose(read_motion(target).positions, wanted.positions, atol=1e-6)
    wanted.save(tmp_path / "wanted.npz")
    assert call(capsys, "view", str(clip), flag, "--out", str(page), "--no-open")[0] == 0
    assert call(capsys, "view", str(tmp_path / "wanted.npz"), "--out", str(other), "--no-open")[0] == 0
    assert page.read_text().replace("given", "wanted") == other.read_text()


@pytest.mark.parametrize("verb", READERS)
@pytest.mark.parametrize(
    ("flags", "message"),
    [(["--up", "w"], "up: w"), (["--unit", "ell"], "unit: ell"), (["--mapping", "MAP"], "map.json: left_kne")],
)
def test_wrong_words_are_refused_by_every_verb(clip, tmp_path, models, capsys, verb, flags, message):
    (tmp_path / "map.json").write_text('{"left_kne": "left_knee"}')
    flags = [str(tmp_path / "map.json") if flag == "MAP" else flag for flag in flags]
    more = {"convert": [str(tmp_path / "out.npz")], "view": ["--no-open", "--out", str(tmp_path / "out.html")]}
    code, out, err = call(capsys, verb, str(clip), *more.get(verb, models), *flags)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert message in err


def test_a_mapping_file_says_all_of_it(clip, tmp_path, capsys):
    """Keys beside the roles count for every verb; a flag counts before them."""
    told = tmp_path / "map.json"
    told.write_text(json.dumps({"up": "-y", "unit": "dm", "mirror": True, "skip_first": True}), encoding="utf-8-sig")
    line = ["convert", str(clip), str(tmp_path / "out.npz"), "--mapping", str(told), "--force"]
    assert call(capsys, *line)[0] == 0
    wanted = read_motion(clip, up="-y", unit="dm", mirror=True, skip_first=True)
    np.testing.assert_allclose(read_motion(tmp_path / "out.npz").positions, wanted.positions, atol=1e-6)
    assert call(capsys, *line, "--unit", "cm")[0] == 0
    np.testing.assert_allclose(read_motion(tmp_path / "out.npz").positions, wanted.positions / 10, atol=1e-6)


def test_convert_says_how_it_read(clip, tmp_path, capsys):
    line = ["convert", str(clip), str(tmp_path / "out.npz"), "--force"]
    code, out, err = call(capsys, *line, "-v")
    assert (code, out) == (0, f"{tmp_path / 'out.npz'}\n")
    assert err.startswith(f"{clip}: up y (")
    assert "unit 0.01 m (" in err
    assert "roles by names" in err
    err = call(capsys, *line, "-v", "--up=-y", "--unit", "dm", "--mirror", "--skip-first")[2]
    assert "up -y (given), unit 0.1 m (given), mirrored (given), first frame left out (given), roles by names" in err
    assert call(capsys, *line)[2] == ""


@pytest.fixture
def some_bad(clip, tmp_path) -> list[str]:
    """A good file, a cut one, a second good one, and a rig that nothing tells."""
    (tmp_path / "cut.bvh").write_text(clip.read_text()[:3000])
    demo_clip(4)[0].save(tmp_path / "other.bvh")
    smpl = Skeleton.named("smpl22")
    uneven = smpl.offsets.copy()
    uneven[smpl.joints.index("left_knee")] *= 2  # legs that are no twins: the tree does not tell either
    rig = Skeleton.from_rig("numbered", [f"bone{i}" for i in range(22)], smpl.parents, uneven)
    Motion(demo_clip(5)[0].positions, 20, rig).save(tmp_path / "odd.npz")
    return [str(clip), *(str(tmp_path / name) for name in ("cut.bvh", "other.bvh", "odd.npz"))]


def test_a_bad_file_among_several_is_named_and_the_others_are_captioned(some_bad, models, capsys):
    first, cut, other, odd = some_bad
    code, out, err = call(capsys, "caption", *some_bad, "--json", *models)
    rows = json.loads(out)
    assert (code, [row["file"] for row in rows]) == (2, [first, other])
    alone = json.loads(call(capsys, "caption", other, "--json", *models)[1])
    assert rows[1]["captions"] == alone[0]["captions"]
    errors = [line for line in err.splitlines() if line.startswith("error: ")]
    assert len(errors) == 2
    assert errors[0].startswith(f"error: {cut}, line ")
    assert errors[1].startswith(f"error: {odd}, ")
    assert "roles of no known joint" in errors[1]
    assert call(capsys, "caption", first, other, *models)[0] == 0


def test_the_others_are_stylized_and_shown(some_bad, tmp_path, stylers, capsys):
    first, cut, other, odd = some_bad
    made = ["--format", "npy", "--out", str(tmp_path / "made")]
    code, out, err = call(capsys, "stylize", *some_bad, *made, *stylers)
    assert (code, [Path(line).stem for line in out.split()]) == (2, ["given-restyled", "other-restyled"])
    assert cut in err
    assert odd in err
    page = tmp_path / "page.html"
    code, out, err = call(capsys, "view", first, cut, other, "--out", str(page), "--no-open")
    assert (code, out) == (2, f"{page}\n")
    assert "given" in page.read_text()
    assert "other" in page.read_text()
    assert [line for line in err.splitlines() if "error" in line and cut in line]


def test_where_all_fail_nothing_is_written(some_bad, tmp_path, models, capsys):
    _, cut, _, odd = some_bad
    code, out, err = call(capsys, "caption", cut, odd, *models)
    assert (code, out) == (2, "")
    assert [line.split(", ")[0] for line in err.splitlines() if line[:5] == "error"] == [
        f"error: {cut}",
        f"error: {odd}",
    ]
    code, out, err = call(capsys, "view", cut, "absent.bvh", "--out", str(tmp_path / "page.html"), "--no-open")
    assert (code, out, err.count("\n")) == (2, "", 2)
    assert not (tmp_path / "page.html").exists()


def test_a_wrong_option_is_said_once_of_several_files(clip, tmp_path, models, capsys):
    demo_clip(4)[0].save(tmp_path / "other.bvh")
    code, out, err = call(capsys, "caption", str(clip), str(tmp_path / "other.bvh"), "--system", "octopus", *models)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "octopus" in err


def test_a_byte_order_mark_is_no_part_of_the_first_prompt(tmp_path, models, capsys):
    (tmp_path / "prompts.txt").write_text("a person waves\n", encoding="utf-8-sig")
    arguments = ["--file", str(tmp_path / "prompts.txt"), "--out", str(tmp_path), "--format", "npy", "--json"]
    (row,) = json.loads(call(capsys, "generate", *arguments, *models)[1])
    assert row["text"] == "a person waves"


def test_a_style_of_any_name_stays_in_the_folder():
    """A label may hold what no file's name may."""
    options = build_parser(COMMANDS).parse_args(["stylize", "in/walk.bvh", "--style", "酔った / ../Old", "-n", "2"])
    assert _names(options) == [["walk-酔った-old-0", "walk-酔った-old-1"]]
