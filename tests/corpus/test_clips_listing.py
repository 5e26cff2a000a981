"""Every kind of bad line and caption becomes one problem that names file, line, value and rule."""

import json
from pathlib import Path

import numpy as np
import pytest

from motionary.corpus.clips import Caption, Clip, checked_captions
from motionary.corpus.config import DataConfig
from motionary.corpus.sources import FolderSource, inventory, open_sources, root_names
from motionary.errors import InputError


def line(name, *texts):
    return {"motion": f"motions/{name}.npy", "fps": 20, "captions": [{"text": text} for text in texts]}


def listed(root):
    return FolderSource(root, "root").clips()


BAD_LINES = [
    (line("absent"), "absent"),
    ({"fps": 20}, "path of a motion"),
    ({"motion": "../outside.npy", "fps": 20}, "inside the folder"),
    ({"motion": "/etc/passwd", "fps": 20}, "inside the folder"),
    ({"motion": "motions/notes.txt", "fps": 20}, "must end in"),
    ({"motion": "motions/good.npy"}, "needed for arrays"),
    (line("good") | {"fps": -1}, "above 0"),
    (line("good") | {"fps": True}, "above 0"),
    (line("good") | {"fps": "20"}, "above 0"),
    (line("good") | {"style": 7}, "string"),
    (line("good") | {"captions": "walks"}, "list"),
]


@pytest.mark.parametrize(("bad", "rule"), BAD_LINES)
def test_a_bad_line_is_one_problem_and_the_rest_stays(tmp_path, folder_of, bad, rule):
    folder_of(tmp_path, [line("first", "a walk"), line("good", "a run")])
    text = (tmp_path / "clips.jsonl").read_text().splitlines()[0] + "\n" + json.dumps(bad) + "\n"
    (tmp_path / "clips.jsonl").write_text(text)
    clips, problems = listed(tmp_path)
    assert [clip.id for clip in clips] == ["root/first"]
    assert len(problems) == 1
    assert "clips.jsonl:2" in problems[0].what
    assert rule in problems[0].rule


@pytest.mark.parametrize(
    "spelled", ["motions\\\\g\u00f6\u00f6d.npy", "./motions/g\u00f6\u00f6d.npy", "motions/go\u0308o\u0308d.npy"]
)
@pytest.mark.parametrize("stored", ["g\u00f6\u00f6d.npy", "go\u0308o\u0308d.npy"])
def test_paths_as_windows_and_macos_spell_them(tmp_path, folder_of, spelled, stored):
    folder_of(tmp_path, [line("good", "a run")])
    (tmp_path / "motions" / "good.npy").rename(tmp_path / "motions" / stored)
    (tmp_path / "clips.jsonl").write_text(json.dumps(line("good", "a run") | {"motion": spelled}) + "\n")
    clips, problems = listed(tmp_path)
    assert problems == []
    assert Path(clips[0].load.path) == tmp_path / "motions" / stored


@pytest.mark.parametrize("name", ["CLIPS.JSONL", "clips.json", "clips.jsonl.txt"])
def test_a_listing_under_another_name_is_told(tmp_path, folder_of, name):
    folder_of(tmp_path, [line("good", "a run")])
    (tmp_path / "clips.jsonl").rename(tmp_path / name)
    clips, problems = listed(tmp_path)
    assert len(clips) == 1
    assert [(Path(p.what).name, p.rule) for p in problems] == [(name, "must be called clips.jsonl")]


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
def test_listings_in_the_encodings_of_windows(tmp_path, folder_of, encoding):
    folder_of(tmp_path, [line("first", "a walk to a café"), line("good", "a run")])
    text = (tmp_path / "clips.jsonl").read_text()
    (tmp_path / "clips.jsonl").write_text(text.replace("\n", "\r\n"), encoding=encoding)
    (tmp_path / "mapping.json").write_text('{"up": "y"}', encoding=encoding)
    clips, problems = listed(tmp_path)
    assert ([clip.id for clip in clips], problems) == (["root/first", "root/good"], [])
    assert clips[0].captions[0].text == "a walk to a café"


def test_a_line_in_another_encoding_spoils_no_other(tmp_path, folder_of):
    folder_of(tmp_path, [line("first", "a walk"), line("good", "a run")])
    rows = [json.dumps(line(name, "to a café"), ensure_ascii=False) for name in ("first", "good")]
    data = rows[0].encode("latin-1") + b"\n" + rows[1].encode() + b"\n"
    (tmp_path / "clips.jsonl").write_bytes(data)
    clips, problems = listed(tmp_path)
    assert ([clip.captions[0].text for clip in clips], problems) == (["to a café"] * 2, [])


def test_unknown_keys_are_said_once_with_the_nearest_known_one(tmp_path, folder_of):
    slips = {"caption": "a walk", "notes": 1, "UP": "z"}
    folder_of(
        tmp_path, [line("first", "a walk") | slips, line("good") | slips | {"captions": [{"text": "x y", "strat": 0}]}]
    )
    clips, problems = listed(tmp_path)
    assert len(clips) == 2
    said = {problem.value: f"{problem.what}: {problem.rule}" for problem in problems}
    assert sorted(said) == ["UP", "caption", "notes", "strat"]
    assert "did you mean 'captions'?" in said["caption"]
    assert "did you mean 'up'?" in said["UP"]
    assert "did you mean" not in said["notes"]
    assert "did you mean 'start'?" in said["strat"]
    assert "clips.jsonl:1" in said["caption"]
    assert "captions[0]" in said["strat"]


def test_a_line_and_a_mapping_file_say_how_to_read(tmp_path, folder_of):
    """The line's word counts before the folder's, and both before what is measured."""
    folder_of(tmp_path, [line("first", "a walk") | {"up": "z", "unit": "mm"}, line("good", "a run")])
    plain = np.load(tmp_path / "motions" / "good.npy")
    np.save(tmp_path / "motions" / "first.npy", plain)
    (tmp_path / "mapping.json").write_text('{"unit": "dm", "mirror": true, "up": "y"}')
    clips, problems = listed(tmp_path)
    assert problems == []
    (first, one), (good, two) = (clip.load(clip) for clip in clips)
    np.testing.assert_allclose(first.positions, plain[..., [0, 2, 1]] * np.array([-1, 1, -1]) / 1000, atol=1e-6)
    np.testing.assert_allclose(good.positions, plain * np.array([-1, 1, 1]) / 10, atol=1e-6)
    assert (one.reading.up, two.reading.up, one.reading.mirrored) == ("z", "y", True)
    for wrong in ({"up": "w"}, {"mapping": 3}, {"mapping": {"tail": "x"}}, {"mirror": "perhaps"}):
        folder_of(tmp_path, [line("first", "a walk") | wrong])
        clips, problems = listed(tmp_path)
        assert clips == []
        assert "clips.jsonl:1" in problems[0].what or "tail" in str(problems[0])


@pytest.mark.parametrize("text", ["{broken", "[1, 2]", '"text"', "\x00\x01", "[" * 100_000])
def test_lines_that_are_not_objects(tmp_path, folder_of, text):
    folder_of(tmp_path, [line("first", "a walk")])
    with (tmp_path / "clips.jsonl").open("a") as file:
        file.write(text + "\n")
    clips, problems = listed(tmp_path)
    assert len(clips) == 1
    assert ["one JSON object" in problem.rule for problem in problems] == [True]


@pytest.mark.parametrize(
    ("caption", "rule"),
    [
        ({"text": ""}, "non-empty"),
        ({"text": "   "}, "non-empty"),
        ({"text": 5}, "non-empty"),
        ({}, "non-empty"),
        ("walks", "object"),
        ({"text": "walk " * 201}, "at most 1000"),
        ({"text": "一个人在走路"}, "English"),
        ({"text": "человек идёт"}, "English"),
        ({"text": "... 123"}, "English"),
        ({"text": "walks", "start": "0"}, "seconds"),
        ({"text": "walks", "end": float("nan")}, "seconds"),
        ({"text": "walks", "end": True}, "seconds"),
    ],
)
def test_a_bad_caption_is_dropped_and_its_clip_stays(tmp_path, folder_of, caption, rule):
    folder_of(tmp_path, [line("first") | {"captions": [caption, {"text": "a café waiter walks"}]}])
    clips, problems = listed(tmp_path)
    assert [entry.text for entry in clips[0].captions] == ["a café waiter walks"]
    assert len(problems) == 1
    assert "clips.jsonl:1" in problems[0].what
    assert rule in problems[0].rule


def test_duplicate_ids_keep_the_first(tmp_path, folder_of):
    folder_of(tmp_path, [line("one", "a walk"), line("two", "a run"), line("one", "a bow")])
    clips, problems = listed(tmp_path)
    assert [clip.captions[0].text for clip in clips] == ["a walk", "a run"]
    assert "duplicate id" in problems[0].rule
    assert "clips.jsonl:1" in problems[0].rule


def test_equal_stems_in_different_folders_are_different_clips(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        np.save(tmp_path / folder / "x.npy", np.zeros((4, 22, 3), np.float32))
    clips, problems = listed(tmp_path)
    assert [clip.id for clip in clips] == ["root/a/x", "root/b/x"]
    assert not problems
    assert clips[0].fps == 20


def test_files_in_two_formats_are_taken_once_and_said_once(tmp_path):
    (tmp_path / "a").mkdir()
    for name in ("a/x.npy", "a/y.npy", "z.npy"):
        np.save(tmp_path / name, np.zeros((4, 22, 3), np.float32))
    for name in ("a/x.bvh", "z.glb"):
        (tmp_path / name).touch()
    clips, problems = listed(tmp_path)
    assert [Path(clip.where).name for clip in clips] == ["x.bvh", "y.npy", "z.glb"]
    (problem,) = problems
    assert problem.value == "2 of 5 files"
    assert problem.rule == ("left out: 2 .npy, which lie beside a file of the same name; read: 1 .bvh, 1 .npy, 1 .glb")


@pytest.mark.parametrize(
    ("span", "kept"),
    [
        ((0.0, 3.0), (0.0, 3.0)),
        ((None, None), (0.0, 3.0)),
        ((-0.05, 3.09), (0.0, 3.0)),
        ((1.0, 3.2), None),
        ((-0.2, 1.0), None),
        ((2.0, 2.0), None),
        ((2.0, 1.0), None),
        ((3.0, 3.05), None),
    ],
)
def test_captions_must_lie_inside_the_clip(span, kept):
    clip = Clip("root/x", None, "clips.jsonl:9", "root", captions=(Caption("walks", *span),))
    checked, problems = checked_captions(clip, 3.0)
    assert [(entry.start, entry.end) for entry in checked.captions] == ([kept] if kept else [])
    assert len(problems) == (kept is None)
    for problem in problems:
        assert problem.what == "clips.jsonl:9"
        assert "0..3.00 s" in problem.rule


def test_who_wrote_a_caption():
    human = {source: Caption("walks", source=source).human for source in ("", "kit-ml", "label-template", "grammar")}
    assert human == {"": True, "kit-ml": True, "label-template": False, "grammar": False}


def test_missing_empty_and_alike_roots(tmp_path):
    def config(root):
        return DataConfig(source="folder", roots=(str(root),))

    with pytest.raises(InputError, match="existing folder"):
        open_sources(config(tmp_path / "nowhere"))
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="must hold motions"):
        open_sources(config("empty"), tmp_path)
    (tmp_path / "empty" / "notes.txt").write_text("hello")
    with pytest.raises(InputError, match=r"clips\.jsonl or"):
        open_sources(config("empty"), tmp_path)[0].clips()
    assert root_names([tmp_path / "a/clips", tmp_path / "b/clips", tmp_path / "c"]) == ["a-clips", "b-clips", "c"]


def test_inventory_hashes_and_times_every_file(tmp_path, folder_of):
    folder_of(tmp_path / "x", [line("one", "a walk"), line("two", "a run"), line("gone")], {"motions/gone.npy": 0})
    first = inventory(tmp_path / "x", progress=False)
    assert first["clips"] == 2
    assert first["captions"] == 2
    assert [problem["file"] for problem in first["problems"]] == ["clips.jsonl:3: motion"]
    assert {file["path"]: file["seconds"] for file in first["files"]} == {
        "clips.jsonl": None,
        "motions/one.npy": 3.0,
        "motions/two.npy": 3.0,
    }
    np.save(tmp_path / "x/motions/two.npy", np.zeros((60, 22, 3)))
    changed = [a != b for a, b in zip(first["files"], inventory(tmp_path / "x", False)["files"], strict=True)]
    assert changed == [False, False, True]


@pytest.mark.real
def test_real_listings_have_no_problem(shared_data):
    found = {name: FolderSource(shared_data / name, name).clips() for name in ("captioned", "styled", "actions", "bvh")}
    assert {name: len(clips) for name, (clips, _) in found.items()} == {
        "captioned": 541,
        "styled": 2686,
        "actions": 383,
        "bvh": 87,
    }
    assert not [problem for _, problems in found.values() for problem in problems]
