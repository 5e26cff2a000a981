"""What an index leaves replaces nothing but what an index wrote, and keeps what the folder's own listing says."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from motionary.archive import index_folder
from motionary.archive.written_results import CAPTIONS, DUPLICATES, FLAGS, claim
from motionary.cli.commands import main
from motionary.corpus.demo import demo_clip
from motionary.errors import InputError

INDEX = Path(".motionary") / "index" / "index.json"


@pytest.fixture
def folder(tmp_path) -> Path:
    """Holds one motion, `a.bvh`."""
    folder = tmp_path / "mocap"
    folder.mkdir()
    demo_clip(3, 5)[0].save(folder / "a.bvh")
    return folder


@pytest.fixture
def index(folder, pipeline):
    """Indexes the folder."""
    return lambda **given: index_folder(folder, pipeline / "models", None, "cpu", 1, progress=False, **given)


@pytest.mark.parametrize("name", [CAPTIONS, FLAGS, DUPLICATES])
def test_a_file_that_no_index_wrote_stays(folder, name, pipeline, capsys):
    (folder / name).write_text("mine\n")
    assert main(["index", str(folder), "--models", str(pipeline / "models"), "--device", "cpu"]) == 2
    rule = "exists, not as an index wrote it: kept as it is; use --force to replace it"
    assert capsys.readouterr().err == f"error: {folder / name}: {rule}\n"
    assert (folder / name).read_text() == "mine\n"
    assert not (folder / ".motionary").exists()


def test_an_edited_result_stays_and_force_replaces_it(folder, index, pipeline):
    index()
    index()
    wrote = (folder / CAPTIONS).read_text()
    (folder / CAPTIONS).write_text(wrote.replace("text", "texts"))
    with pytest.raises(InputError, match="not as an index wrote it"):
        index()
    assert "texts" in (folder / CAPTIONS).read_text()
    command = ["index", str(folder), "--models", str(pipeline / "models"), "--device", "cpu", "--workers", "1"]
    assert main([*command, "--force"]) == 0
    assert (folder / CAPTIONS).read_text() == wrote
    (folder / CAPTIONS).write_text(wrote.replace("text", "texts"))
    with pytest.raises(InputError, match="not as an index wrote it"):
        index()  # what was replaced by force is no index's now


def test_a_run_killed_between_its_files_goes_on(folder, index):
    """The index is new then, and a result is still as the run before wrote it."""
    index()
    old = (folder / CAPTIONS).read_bytes()
    demo_clip(5, 5)[0].save(folder / "b.bvh")
    index()
    assert (folder / CAPTIONS).read_bytes() != old
    (folder / CAPTIONS).write_bytes(old)
    index()
    assert len((folder / CAPTIONS).read_text().splitlines()) == 2


def test_results_beside_an_index_that_notes_none_are_its_own(folder, index):
    index()
    told = json.loads((folder / INDEX).read_text())
    del told["wrote"]
    (folder / INDEX).write_text(json.dumps(told))
    (folder / CAPTIONS).write_text("of an older version\n")
    index()
    assert "older" not in (folder / CAPTIONS).read_text()


@pytest.mark.parametrize("told", ["{}", "[]", "no json", '{"wrote": 5, "folder": ".", "judge": "", "judge_hash": ""}'])
def test_what_lies_beside_no_valid_index_is_somebodys(tmp_path, told):
    (tmp_path / INDEX).parent.mkdir(parents=True)
    (tmp_path / INDEX).write_text(told)
    (tmp_path / FLAGS).write_text("")
    with pytest.raises(InputError, match="kept as it is"):
        claim(tmp_path, False)
    assert claim(tmp_path, True) == {}


def test_what_is_no_file_is_never_replaced(tmp_path):
    (tmp_path / CAPTIONS).symlink_to("nowhere")
    with pytest.raises(InputError, match="kept as it is"):
        claim(tmp_path, False)
    (tmp_path / CAPTIONS).unlink()
    (tmp_path / CAPTIONS).mkdir()
    with pytest.raises(InputError, match="a folder"):
        claim(tmp_path, True)
    (tmp_path / CAPTIONS).rmdir()
    os.mkfifo(tmp_path / FLAGS)  # would be waited for
    with pytest.raises(InputError, match="kept as it is"):
        claim(tmp_path, False)


def captioned(folder: Path) -> dict:
    (line,) = (folder / CAPTIONS).read_bytes().decode().strip("\n").split("\n")
    return json.loads(line, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_a_listing_in_any_encoding_stays(folder, index, encoding):
    told = {"motion": "a.bvh", "subject": "Jürgen Müller", "license": "CC-BY", "up": "y"}
    (folder / "clips.jsonl").write_bytes((json.dumps(told, ensure_ascii=False) + "\n").encode(encoding))
    index()
    line = captioned(folder)
    assert {key: line[key] for key in told} == told


def test_line_separators_and_spellings_of_paths_stay(folder, index):
    told = {"motion": "./a.bvh", "license": "one\u2028two", "up": "y"}
    (folder / "clips.jsonl").write_text(json.dumps(told, ensure_ascii=False), encoding="utf-8")
    index()
    line = captioned(folder)
    assert {key: line[key] for key in told} == told


def test_what_the_listing_refused_is_left_out(folder, index):
    """Captions that cannot be used, a first line that cannot, and numbers for which JSON has no word."""
    said = {"text": "a  person walks", "source": "anna", "note": "kept", "weight": np.nan}
    refused = [{"text": "walks", "start": np.nan}, "walks", {"text": ""}, {"text": "x" * 2000}, {"text": "走る"}]
    told = {"motion": "a.bvh", "style": "calm", "weight": np.nan, "deep": {"far": [-np.inf]}}
    first = {"motion": "a.bvh", "style": "angry", "fps": -1}
    lines = (first, {**told, "captions": [*refused, said]})
    (folder / "clips.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    found = index()
    assert len(found["problems"]) >= len(refused) + 1
    line = captioned(folder)
    assert (line["style"], line.keys()) == ("calm", {"motion", "style", "captions"})
    assert line["captions"][0] == {"text": "a  person walks", "source": "anna", "note": "kept"}
    assert all(caption["source"] == "motion2text" for caption in line["captions"][1:])
