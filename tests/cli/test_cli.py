"""The commands: on real files, as a user types them; bad input in one line."""

from __future__ import annotations

import io
import json
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from shell import call

from motionary import read_motion
from motionary.cli.command import build_parser
from motionary.cli.commands import COMMANDS
from motionary.cli.outputs import slug
from motionary.errors import InputError


def shell(*arguments: str, text: str = "") -> subprocess.CompletedProcess:
    """The command as its own process."""
    line = [sys.executable, "-m", "motionary.cli", *arguments]
    return subprocess.run(line, input=text, capture_output=True, text=True, timeout=600)


def test_prompts_from_standard_input_become_files(tmp_path, models):
    prompts = "a person walks forward\n\na person waves\n"
    out = ["--out", str(tmp_path / "new/out"), "--format", "npz,bvh", "--json", "--seconds", "2", *models]
    run = shell("generate", "-n", "2", "--seed", "4", *out, text=prompts)
    assert run.returncode == 0, run.stderr
    rows = json.loads(run.stdout)
    assert [(row["text"], row["variant"]) for row in rows] == [
        (text, k) for text in ("a person walks forward", "a person waves") for k in (0, 1)
    ]
    names = [Path(file).name for row in rows for file in row["files"]]
    assert names[:2] == ["0-a-person-walks-forward-0.npz", "0-a-person-walks-forward-0.bvh"]
    for row in rows:
        first, second = (read_motion(file) for file in row["files"])
        assert first.frames == second.frames == 40
        assert np.abs(first.positions - second.positions).max() < 0.2


def test_seeds_repeat_and_names_are_plain(tmp_path, models, capsys):
    motions = []
    for folder, seed in (("a", "1"), ("b", "1"), ("c", "2")):
        out = str(tmp_path / folder)
        code, lines, _ = call(capsys, "generate", "Jump!", "--seed", seed, "--out", out, "--format", "npy", *models)
        assert (code, lines) == (0, f"{out}/jump.npy\n")
        motions.append(read_motion(lines.strip()))
    assert np.array_equal(motions[0].positions, motions[1].positions)
    assert motions[0].frames != motions[2].frames or not np.allclose(motions[0].positions, motions[2].positions)


def test_prompts_from_a_file(tmp_path, models, capsys, monkeypatch):
    (tmp_path / "prompts.txt").write_text("walk\njump\n")
    arguments = ("--out", str(tmp_path), "--format", "npy", *models)
    code, out, _ = call(capsys, "generate", "--file", str(tmp_path / "prompts.txt"), *arguments)
    assert code == 0
    assert [Path(line).name for line in out.splitlines()] == ["0-walk.npy", "1-jump.npy"]
    monkeypatch.setattr(sys, "stdin", io.StringIO("kick\n"))
    code, out, _ = call(capsys, "generate", "-", *arguments)
    assert Path(out.strip()).name == "kick.npy"


def test_unknown_words_are_said(tmp_path, models, capsys):
    text = "a person does a cartwheel, xqzt"
    arguments = ("--out", str(tmp_path), "--format", "npy", "--json", *models)
    code, out, err = call(capsys, "generate", text, "a person walks", *arguments)
    (first, second) = json.loads(out)
    assert code == 0
    assert first["replaced"].keys() == {"cartwheel"}
    assert first["unknown"] == ["xqzt"]
    assert first["distance"] > second["distance"] >= 0
    assert (second["read_as"], second["replaced"], second["unknown"]) == ("a person walk", {}, [])
    assert len(err.splitlines()) == 1
    assert re.match(r'note: "a person does a cartwheel, xqzt" is read as ".*"; not known: cartwheel', err)


def test_parts_that_may_be_lost_are_said_with_what_makes_them(tmp_path, models, capsys):
    out = ("--out", str(tmp_path), "--format", "npy", *models)
    code, _, err = call(capsys, "generate", "a person walks then waves", "a person walks and turns right", *out)
    assert (code, err.count("a part may be lost")) == (0, 1)
    assert 'make one motion of all: "a person walks" "waves" --join\n' in err
    code, files, err = call(capsys, "generate", "a person walks", "waves", "--join", *out)
    assert (code, len(files.splitlines())) == (0, 1)
    assert "a part may be lost" not in err


def test_what_is_written_has_rotations_and_bones_of_one_length_at_any_rate(tmp_path, models, capsys):
    arguments = ("--out", str(tmp_path), "--format", "npz", "--seconds", "2", "--fps", "30", *models)
    code, out, _ = call(capsys, "generate", "Crème brûlée: a person walks!", *arguments)
    assert (code, Path(out.strip()).name) == (0, "creme-brulee-a-person-walks.npz")
    motion = read_motion(out.strip())
    assert (motion.fps, motion.frames) == (30, 59)
    assert motion.rotations is not None
    parents = list(motion.skeleton.parents[1:])
    bones = np.linalg.norm(motion.positions[:, 1:] - motion.positions[:, parents], axis=-1)
    assert np.ptp(bones, axis=0).max() < 1e-3
    code, _, err = call(capsys, "generate", "walk", "--out", str(tmp_path), "--fps", "0", *models)
    assert (code, err[:13]) == (2, "error: fps: 0")


def test_names_of_files_say_any_prompt():
    assert slug("Ça marche, l'été!", "motion") == "ca-marche-l-ete"
    assert slug("人が歩く", "motion") == "人が歩く"
    assert slug("___ !?", "motion") == "motion"
    assert len(slug("a person " * 20, "motion")) <= 48
    assert slug("человек идёт", "motion") == "человек-идёт"
    assert slug("شخص يمشي", "motion") == "شخص-يمشي"
    assert len(slug("人" * 100, "motion").encode()) < 200  # of 255 bytes that a name may have, its number and extension
    assert slug("../../etc/passwd", "motion") == "etc-passwd"


def test_convert_needs_no_torch(clip, tmp_path):
    code = "import sys; from motionary.cli import main; main(sys.argv[1:]); print(*sys.modules)"
    line = [sys.executable, "-c", code, "convert", str(clip), str(tmp_path / "out.glb"), "--fps", "24"]
    run = subprocess.run(line, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr
    assert not {"torch", "spacy", "transformers", "pyarrow", "scipy"} & set(run.stdout.split())


def test_existing_files_are_kept_unless_forced(tmp_path, models, capsys):
    kept = tmp_path / "jump.npy"
    kept.write_text("precious")
    arguments = ("generate", "jump", "--format", "npz,npy", "--out", str(tmp_path), *models)
    code, out, err = call(capsys, *arguments)
    assert (code, out) == (2, "")
    assert "--force" in err
    assert kept.read_text() == "precious"
    assert not (tmp_path / "jump.npz").exists()
    assert call(capsys, *arguments, "--force")[0] == 0
    assert read_motion(kept).frames


@pytest.mark.parametrize(
    ("option", "told"),
    [
        (("--seed", "-1"), "--seed: -1: must be a whole number"),
        (("--system", "nope"), "system: nope: must be one of"),
        (("--seconds", "900"), "seconds: 900"),
        (("--seconds", "1,2"), "must be one number, or one for each"),
        (("--temperature", "0"), "--temperature: 0: must be a number above 0"),
        (("--top-p", "1.5"), "--top-p: 1.5: must be a number above 0, at most 1"),
        (("--loop", "--path", "0,0 0,1"), "contradict each other"),
        (("--format", "fbx"), "format: fbx"),
    ],
)
def test_a_wrong_option_is_said_before_a_file_that_is_there(option, told, tmp_path, models, capsys):
    (tmp_path / "jump.npy").write_text("precious")
    arguments = ("generate", "jump", "--format", "npy", "--out", str(tmp_path), *models)
    code, _, err = call(capsys, *arguments, *option)
    assert code == 2
    assert told in err
    code, _, err = call(capsys, *arguments)
    assert (code, err) == (2, f"error: {tmp_path / 'jump.npy'}: exists: kept as it is; use --force to replace it\n")


def test_convert_and_edit_say_wrong_options_before_a_file_that_is_there(clip, tmp_path, models, capsys):
    for name in ("out.npz", "given-extend.bvh"):
        (tmp_path / name).touch()
    code, _, err = call(capsys, "convert", str(clip), str(tmp_path / "out.npz"), "--fps", "-3")
    assert (code, "fps: -3" in err, "exists" in err) == (2, True, False)
    edit = ("edit", str(clip), "--out", str(tmp_path), *models, "--extend")
    assert "exists" not in call(capsys, *edit, "900")[2]
    assert "use --force to" in call(capsys, *edit, "1")[2]
    (tmp_path / "given-old.bvh").touch()
    code, _, err = call(capsys, "stylize", str(clip), "--style", "old", "--strength", "-1", "--out", str(tmp_path))
    assert (code, "--strength: -1: must be a number from 0 to 100" in err, "exists" in err) == (2, True, False)
    edit = (edit[0], edit[1], "a person does a cartwheel", *edit[2:])
    assert "not known: cartwheel" in call(capsys, *edit, "1", "--force")[2]
    with pytest.raises(InputError, match="use force=True to"):
        read_motion(clip).save(tmp_path / "out.npz", force=False)


def test_caption_says_a_line_for_each(clip, models, capsys):
    code, out, _ = call(capsys, "caption", str(clip), "-n", "2", *models)
    assert (code, len(out.splitlines())) == (0, 2)
    code, several, _ = call(capsys, "caption", str(clip), str(clip), "--json", "--end", "3", *models)
    rows = json.loads(several)
    assert [row["file"] for row in rows] == [str(clip)] * 2
    assert rows[0]["captions"] == rows[1]["captions"]


def test_search_lists_windows(models, capsys):
    code, out, err = call(capsys, "search", "a person walks", "-k", "3", *models)
    assert code == 0
    distances = [float(line.split("\t")[0]) for line in out.splitlines()]
    assert len(distances) == 3
    assert distances == sorted(distances)
    assert "columns: distance of motion and text (from 0 up" in err
    two = call(capsys, "search", "a person walks", "jump", "-k", "1", *models)[1]
    assert [line.split("\t")[0] for line in two.splitlines()] == ["a person walks", "jump"]
    rows = json.loads(call(capsys, "search", "a person walks", "-k", "3", "--json", *models)[1])
    assert rows[0]["matches"][0]["captions"]


def test_convert_cuts_and_resamples(clip, tmp_path, capsys):
    target = tmp_path / "new/out.npz"
    arguments = ("convert", str(clip), str(target), "--fps", "30", "--start", "0.5")
    assert call(capsys, *arguments) == (0, f"{target}\n", "")
    before, after = read_motion(clip), read_motion(target)
    assert after.fps == 30
    assert after.duration == pytest.approx(before.duration - 0.5, abs=0.06)
    np.testing.assert_allclose(after.positions[0], before.positions[10], atol=1e-3)


def test_a_mapping_makes_an_unknown_rig_known(clip, tmp_path, models, capsys):
    """The same clip with joints that are numbered, and the file that says which is which.

    The tree alone tells that too, until one thigh is longer than the other.
    """
    text, mapping = clip.read_text(), {}
    for number, role in enumerate(read_motion(clip).skeleton.joints):
        text = re.sub(rf"(ROOT|JOINT) {role}\n", rf"\1 bone{number}\n", text)
        mapping[role] = f"bone{number}"
    numbered, told = tmp_path / "numbered.bvh", tmp_path / "rig.json"
    numbered.write_text(text)
    told.write_text(json.dumps(mapping))
    known = call(capsys, "caption", str(clip), *models)
    assert call(capsys, "caption", str(numbered), *models) == known
    knee = mapping["left_knee"]
    uneven = tmp_path / "uneven.bvh"
    uneven.write_text(re.sub(rf"(JOINT {knee}\n\s*{{\n\s*OFFSET \S+) \S+", r"\1 -70.0", text))
    code, _, err = call(capsys, "caption", str(uneven), *models)
    assert code == 2
    assert "roles of no known joint" in err
    assert "--mapping" in err
    assert call(capsys, "caption", str(uneven), "--mapping", str(told), *models)[0] == 0
    assert call(capsys, "caption", str(numbered), "--mapping", str(told), *models) == known
    target = tmp_path / "out.npz"
    line = ("convert", str(numbered), str(target), "--skeleton", "smpl22", "--mapping", str(told))
    assert call(capsys, *line)[0] == 0
    assert read_motion(target).skeleton.roles.keys() == mapping.keys()
    told.write_text(json.dumps(mapping | {"head": "bone99"}))
    code, _, err = call(capsys, *line, "--force")
    assert (code, err) == (2, f"error: {told}: bone99: no joint of this name in the skeleton\n")


@pytest.mark.real
def test_real_bvh_becomes_glb_and_words(shared_data, tmp_path, models, capsys):
    source = sorted((shared_data / "bvh").rglob("*.bvh"))[0]
    target = tmp_path / "out.glb"
    assert call(capsys, "convert", str(source), str(target), "--end", "2")[:2] == (0, f"{target}\n")
    assert target.read_bytes()[:4] == b"glTF"
    assert call(capsys, "convert", str(source), str(tmp_path / "on.npy"), "--skeleton", "smpl22")[0] == 0
    assert read_motion(tmp_path / "on.npy").positions.shape[1] == 22
    assert call(capsys, "caption", str(source), *models)[0] == 0


def test_view_writes_a_page(clip, tmp_path, capsys, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    code, out, _ = call(capsys, "view", str(clip))
    page = Path(out.strip())
    assert code == 0
    assert page.read_text().lower().startswith("<!doctype html>")
    assert opened == [page.as_uri()]
    target = str(tmp_path / "p.html")
    assert call(capsys, "view", str(clip), str(clip), "--out", target, "--no-open")[:2] == (0, f"{target}\n")
    assert len(opened) == 1
    assert call(capsys, "view", str(clip), "--out", target, "--no-open")[0] == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["generate", "walk", "--models", "nowhere"], "nowhere: missing"),
        (["generate", "walk", "--format", "fbx"], "format: fbx"),
        (["generate", "w" * 10_000], "at most 1000 characters"),
        (["generate", "   "], "must not be empty"),
        (["generate", "walk", "--file", "x"], "not both"),
        (["generate", "--file", "nowhere.txt"], "nowhere.txt: missing: must be a text file with one prompt a line\n"),
        (["generate", "--file", "."], ".: a folder: must be a text file"),
        (["generate", "walk", "-n", "0"], "-n: 0: must be from 1 to 10,000"),
        (["generate", "walk", "-n", "1" + "0" * 400], "-n: a number of 401 digits: must be from 1 to 10,000"),
        (["generate", "walk", "--keyframe", "0="], "--keyframe: 0=: must name a file"),
        (["generate", "walk", "--path", "0,0 1e308,1"], "0,0 1e308,1: no point may be farther than 1e+06 m away"),
        (["generate", "walk", "--path", "0,0 x,1"], "--path: 0,0 x,1: must be points x,z between blanks"),
        (["generate", "--file", "/dev/zero"], "/dev/zero: too long"),
        (["caption", "CLIP", "--models", "MODELS", "--device", "nope"], "device: nope: must be auto, cpu or a device"),
        (["generate", "walk", "-n", "x"], "invalid whole number"),
        (["generate", "walk", "--out", "/proc/nothing"], "/proc/nothing"),
        (["caption", "nowhere.bvh"], "nowhere.bvh: missing"),
        (["search", "walk", "--in", "nowhere"], "nowhere: missing: must be a folder that `motionary index` has read"),
        (["caption", "."], ".: a folder: must be a file; name those in it, as ./*.bvh, or take all of them: motionary"),
        (["view", "."], ".: a folder: must be a file"),
        (["caption", "CLIP", "--start", "5", "--end", "2"], "--start, --end"),
        (["convert", "CLIP", "out.fbx"], "format: fbx"),
        (["convert", "CLIP", "out"], "format: none"),
        (["convert", "CLIP", "BROKEN"], "format: txt"),
        (["convert", "BROKEN", "out.npz"], ".txt"),
        (["convert", "CLIP", "CLIP"], "--force"),
        (["convert", "CLIP", "new.npz", "--fps", "-3"], "fps: -3"),
        (["convert", "CLIP", "new.npz", "--skeleton", "octopus"], "octopus"),
        (["view", "CLIP", "--out", "page.txt"], "must end in .html"),
        (["dance"], "invalid choice: 'dance'"),
        ([], "required"),
    ],
)
def test_bad_input_is_one_line_and_code_2(arguments, message, clip, pipeline, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    broken = tmp_path / "broken.txt"
    broken.write_text("HIERARCHY")
    names = {"CLIP": str(clip), "BROKEN": str(broken), "MODELS": str(pipeline / "models")}
    before = sorted(tmp_path.iterdir())
    code, out, err = call(capsys, *[names.get(a, a) for a in arguments])
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert message in err
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_closed_streams_are_empty_ones(clip, tmp_path, closed):
    """Services start programs so; a file opened in the place of a stream must not be written into by mistake."""
    command = f'exec "$0" -m motionary.cli convert "$1" "$2" {closed}'
    target = tmp_path / "again.bvh"
    run = subprocess.run(["sh", "-c", command, sys.executable, str(clip), str(target)], check=False)
    assert run.returncode == 0
    assert read_motion(target).frames == read_motion(clip).frames


def test_a_truncated_file_is_one_line_of_a_process(clip, tmp_path):
    half = tmp_path / "half.bvh"
    half.write_text(clip.read_text()[:3000])
    run = shell("convert", str(half), str(tmp_path / "out.glb"))
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.count("\n") == 1
    assert "half.bvh" in run.stderr


@pytest.mark.parametrize(
    ("damaged", "command", "stage"),
    [
        ("models/motion2text/model.safetensors", "caption", "motion2text"),
        ("models/motion2text/config.json", "caption", "motion2text"),
        ("data/corpus/frames.npy", "search", "preprocess"),
        ("models/retrieval/motions.npy", "search", "retrieval"),
    ],
)
def test_damaged_models_name_the_file_and_the_stage(pipeline, clip, tmp_path, capsys, damaged, command, stage):
    shutil.copytree(pipeline, tmp_path / "project")
    file = tmp_path / "project" / damaged
    file.write_bytes(file.read_bytes()[:-9])
    asked = str(clip) if command == "caption" else "a person walks"
    models = str(tmp_path / "project/models")
    code, _, said = call(capsys, command, asked, "--models", models, "--device", "cpu")
    assert code == 2
    (line,) = said.splitlines()
    assert line.startswith(f"error: {file}: ")
    assert line.endswith(f"run `dvc repro {stage}`")


def test_help_shows_examples_that_parse(capsys):
    """Every example is read by the very parser that shows it."""
    import shlex

    parser = build_parser(COMMANDS)
    for command in COMMANDS:
        code, out, _ = call(capsys, command.name, "--help")
        assert code == 0
        examples = [line.split(" | ")[-1].strip() for line in out.split("examples:\n")[1].splitlines() if line.strip()]
        assert examples
        for example in examples:
            words = shlex.split(example)
            assert words[:2] == ["motionary", command.name]
            assert parser.parse_args(words[1:]).run is command.run


def test_help_answers_at_once_and_loads_nothing_heavy():
    """In at most 0.3 s, the median of five; what would take longer is not even begun."""
    taken = []
    for _ in range(5):
        begin = time.perf_counter()
        run = shell("--help")
        taken.append(time.perf_counter() - begin)
        assert run.returncode == 0
        assert all(f"\n    {command.name} " in run.stdout for command in COMMANDS)
    assert sorted(taken)[2] <= 0.3
    code = "import sys, motionary.cli.commands as c; c.build_parser(c.COMMANDS); print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert {"motionary.cli", "argparse"} <= set(loaded)
    assert not {"numpy", "torch", "spacy", "transformers", "pyarrow", "viser"} & set(loaded)


def test_the_page_without_its_extra_names_what_to_install():
    code = "import sys; sys.modules['viser'] = None; from motionary.cli import main; sys.exit(main(['app']))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr == 'error: viser: not installed: the page needs it: pip install "motionary[app]"\n'
