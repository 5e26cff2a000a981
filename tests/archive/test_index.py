"""A folder of motion is read once, wherever the run was killed, and answers in moments."""

from __future__ import annotations

import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from acclaim_files import amc, asf
from planted import FAULTS

from motionary.archive import Archive, index_folder
from motionary.archive.duplicates import near_duplicates
from motionary.archive.moments import INSTANTS, cuts, windows_of
from motionary.cli.commands import main
from motionary.corpus.clips import CLIP_KEYS
from motionary.corpus.demo import demo_clip
from motionary.corpus.sources import FolderSource
from motionary.corpus.store import Corpus
from motionary.dictionary import load
from motionary.errors import InputError
from motionary.systems.registry import EMBED

DEMO = (0, 1, 5, 3)  # of seed 5: all of them move


@pytest.fixture(scope="module")
def recordings(tmp_path_factory) -> Path:
    """Four clips of the demo grammar as BVH, one of them twice, one jittering, one that is no motion, a long one."""
    folder = tmp_path_factory.mktemp("archive") / "mocap"
    (folder / "day").mkdir(parents=True)
    for i in range(4):
        demo_clip(DEMO[i], 5)[0].save(folder / "day" / f"clip_{i}.bvh")
    shutil.copy(folder / "day" / "clip_1.bvh", folder / "day" / "again.bvh")
    motion = demo_clip(7, 5)[0]
    np.save(folder / "shaky.npy", FAULTS["jitter"](motion.positions, np.random.default_rng(0), 20).astype(np.float32))
    (folder / "broken.bvh").write_text("HIERARCHY\nnothing of the kind\n")
    long = np.concatenate([demo_clip(i, 6)[0].positions for i in range(3)])
    np.save(folder / "long.npy", long.astype(np.float32))
    return folder


@pytest.fixture(scope="module")
def indexed(recordings, pipeline) -> dict:
    """The counts of its index, which lies in the folder."""
    return index_folder(recordings, pipeline / "models", device="cpu", workers=1, progress=False)


def lines(path: Path) -> list[dict]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_everything_is_counted(recordings, indexed):
    assert indexed["clips"] == 8
    assert indexed["problems"] == []
    assert indexed["flagged"]["unreadable"] == 1
    assert indexed["flagged"]["jitter"] == 1
    told = {line["motion"]: line["flags"] for line in lines(recordings / "flags.jsonl")}
    assert "broken.bvh" in told
    assert "jitter" in told["shaky.npy"]
    pairs = lines(recordings / "duplicates.jsonl")
    same = {tuple(sorted(end["motion"] for end in pair["motions"])) for pair in pairs if pair["joints_m"] < 1e-3}
    assert same == {("day/again.bvh", "day/clip_1.bvh")}


def test_captions_make_the_folder_a_data_root(recordings, indexed, tmp_path):
    root = tmp_path / "root"
    shutil.copytree(recordings, root)
    (root / "captions.jsonl").rename(root / "clips.jsonl")
    clips, problems = FolderSource(root, "root").clips()
    assert problems == []
    assert {clip.id for clip in clips} == {f"root/day/{n}" for n in ("again", *(f"clip_{i}" for i in range(4)))}
    listed = lines(root / "clips.jsonl")
    assert all(set(line) <= set(CLIP_KEYS) for line in listed)
    assert all(0 <= c["start"] < c["end"] and c["source"] for line in listed for c in line["captions"])


def test_what_a_listing_says_stays(tmp_path, pipeline):
    folder = tmp_path / "listed"
    folder.mkdir()
    demo_clip(3, 5)[0].save(folder / "a.bvh")
    said = {"text": "a person acts", "source": "anna"}
    (folder / "clips.jsonl").write_text(json.dumps({"motion": "a.bvh", "subject": "s", "captions": [said]}) + "\n")
    index_folder(folder, pipeline / "models", tmp_path / "out", "cpu", 1, progress=False)
    (line,) = lines(tmp_path / "out" / "captions.jsonl")
    assert line["subject"] == "s"
    assert line["captions"][0] == said
    assert not (folder / "captions.jsonl").exists()


def test_what_a_listing_says_of_reading_stays_however_it_spells_the_path(tmp_path, pipeline):
    folder = tmp_path / "listed"
    (folder / "day").mkdir(parents=True)
    motion = demo_clip(3, 5)[0]
    np.save(folder / "day" / "a.npy", motion.positions[..., [0, 2, 1]] * [1, -1, 1] * 100)  # z up, centimetres
    told = {"motion": "./day//a.npy", "fps": motion.fps, "up": "z", "unit": "cm", "mirror": False}
    (folder / "clips.jsonl").write_text(json.dumps(told) + "\n")
    index_folder(folder, pipeline / "models", tmp_path / "out", "cpu", 1, progress=False)
    (line,) = lines(tmp_path / "out" / "captions.jsonl")
    assert {key: line[key] for key in told} == told


def test_a_folder_of_which_nothing_can_be_read_is_graded_and_read_when_it_can(tmp_path, pipeline):
    """What is mended, in the file or beside it, is read by the next run; rows of the past do not pile up."""
    options = {"models": pipeline / "models", "device": "cpu", "workers": 1, "progress": False}
    folder = tmp_path / "mocap"
    folder.mkdir()
    motion = demo_clip(3, 5)[0]
    motion.save(folder / "a.bvh")
    whole = (folder / "a.bvh").read_text()
    (folder / "a.bvh").write_text(whole[:200])
    found = index_folder(folder, **options)
    assert (found["clips"], found["windows"], found["flagged"]) == (1, 0, {"unreadable": 1})
    assert lines(folder / "captions.jsonl") == []
    (told,) = lines(folder / "flags.jsonl")
    assert list(told["flags"]) == ["unreadable"]
    for _ in range(2):
        (folder / "a.bvh").write_text(whole)
        found = index_folder(folder, **options)
        assert (found["clips"], found["flagged"]) == (1, {})
        assert found["windows"] > 0
    assert len(list(folder.glob(".motionary/parts-*/[!.]*.part"))) == 1


def test_a_skeleton_that_is_put_beside_a_motion_or_changed_is_read(tmp_path, pipeline):
    options = {"models": pipeline / "models", "device": "cpu", "workers": 1, "progress": False}
    folder = tmp_path / "mocap"
    folder.mkdir()
    (folder / "02_01.amc").write_text(amc(60))
    for skeleton, readable in ((None, False), (asf(), True), (asf()[:100], False), (asf(), True)):
        if skeleton is not None:
            (folder / "02.asf").write_text(skeleton)
        found = index_folder(folder, **options)
        assert ("unreadable" not in found["flagged"], found["windows"] > 0) == (readable, readable)


def test_a_moment_is_found_by_its_own_place(recordings, indexed, pipeline):
    """The embedding of a window, as a query, finds that window first; moments of one clip do not overlap."""
    archive, dictionary = Archive(recordings), load(pipeline / "models", "cpu")
    row = archive.windows["clip"].index(archive.clips["file"].index("long.npy"))
    moments = archive._nearest(np.asarray(archive.embeddings[row]), 20, sound=False)
    assert (moments[0].motion, moments[0].start) == ("long.npy", archive.windows["start"][row])
    assert moments[0].distance < 1e-4
    own = sorted((m.start, m.end) for m in moments if m.motion == "long.npy")
    assert all(one[1] <= other[0] for one, other in itertools.pairwise(own))
    assert not any(m.flags for m in archive._nearest(np.asarray(archive.embeddings[row]), 20, sound=True))
    found = archive.search(dictionary, ["a person walks", "a person jumps"], k=3)
    query = dictionary.embed(texts="a person jumps")[0]
    best = np.linalg.norm(np.asarray(archive.embeddings) - query, axis=-1).min()
    assert len(found) == 2
    assert found[1][0].distance == pytest.approx(best, abs=1e-5)


def test_windows_are_embedded_as_the_dictionary_embeds_them(recordings, indexed, pipeline):
    archive, dictionary = Archive(recordings), load(pipeline / "models", "cpu")
    from motionary.formats import read_motion

    motion = read_motion(recordings / "day" / "clip_0.bvh")
    row = archive.windows["clip"].index(archive.clips["file"].index("day/clip_0.bvh"))
    judge = dictionary.opened(EMBED)
    (cut,) = cuts(motion, judge.context)[:1]
    assert np.allclose(judge.motions([cut.features])[0], archive.embeddings[row], atol=1e-4)


def test_nothing_is_read_twice_and_a_changed_file_is_read_again(recordings, indexed, pipeline, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(recordings, folder)
    options = {"models": pipeline / "models", "device": "cpu", "workers": 1, "progress": False}
    index_folder(folder, **options)
    (parts,) = (folder / ".motionary").glob("parts-*")
    before = {path.name: path.stat().st_mtime_ns for path in parts.iterdir()}
    demo_clip(9, 5)[0].save(folder / "day" / "new.bvh")
    (folder / "day" / "again.bvh").unlink()
    found = index_folder(folder, **options)
    after = {path.name: path.stat().st_mtime_ns for path in parts.iterdir()}
    assert found["clips"] == 8
    assert found["duplicates"] == indexed["duplicates"] - 1
    assert before.items() <= after.items()
    assert len(after) == len(before) + 1


def test_a_killed_run_goes_on(recordings, indexed, pipeline, tmp_path):
    """Killed as soon as its first part stands: the results are those of an unbroken run."""
    folder = tmp_path / "copy"
    folder.mkdir()
    for i in range(66):  # a second part takes as long as the first
        shutil.copy(recordings / "day" / f"clip_{i % 4}.bvh", folder / f"{i:03d}.bvh")
    command = [sys.executable, "-m", "motionary.cli", "index", str(folder), "--models", str(pipeline / "models")]
    command += ["--device", "cpu", "--workers", "1"]
    running = subprocess.Popen(command, stderr=subprocess.DEVNULL, env=os.environ)
    while running.poll() is None and not list(folder.glob(".motionary/parts-*/[!.]*.part")):
        time.sleep(0.01)
    running.send_signal(signal.SIGKILL)
    running.wait()
    assert not (folder / "captions.jsonl").exists()
    stamps = {part: part.stat().st_mtime_ns for part in folder.glob(".motionary/parts-*/[!.]*.part")}
    assert stamps
    found = index_folder(folder, pipeline / "models", None, "cpu", 1, progress=False)
    assert found["clips"] == 66
    assert {part: part.stat().st_mtime_ns for part in stamps} == stamps
    assert len(lines(folder / "captions.jsonl")) == 66


def test_the_shell_indexes_and_searches(recordings, pipeline, tmp_path, capsys):
    models = ["--models", str(pipeline / "models"), "--device", "cpu"]
    assert main(["index", str(recordings), "--out", str(tmp_path), "--workers", "1", "--json", *models]) == 0
    assert json.loads(capsys.readouterr().out)["clips"] == 8
    assert main(["search", "a person walks", "--in", str(tmp_path), "-k", "2", *models]) == 0
    said = capsys.readouterr()
    out = said.out.splitlines()
    assert len(out) == 2
    assert all(" s\t" in line for line in out)
    assert said.err.splitlines()[-1].startswith("columns: distance")


def test_what_a_search_names_can_be_opened_from_here_and_after_a_move(recordings, pipeline, tmp_path, monkeypatch):
    shutil.copytree(recordings, tmp_path / "one" / "mocap", ignore=shutil.ignore_patterns(".motionary"))
    monkeypatch.chdir(tmp_path)
    index_folder("one/mocap", pipeline / "models", "one/out", "cpu", 1, progress=False)
    (tmp_path / "one").rename(tmp_path / "two")
    dictionary = load(pipeline / "models", "cpu")
    (below,) = Archive("two/out").search(dictionary, "a person walks", k=1)
    assert below.file == f"two/mocap/{below.motion}"
    assert Path(below.file).is_file()
    monkeypatch.chdir(tmp_path / "two" / "out")
    (outside,) = Archive(".").search(dictionary, "a person walks", k=1)
    assert outside.file == str(tmp_path / "two" / "mocap" / below.motion)


@pytest.mark.parametrize("case", ["no folder", "no index", "other models"])
def test_what_cannot_be_is_one_line(case, recordings, indexed, pipeline, tmp_path, capsys):
    models = ["--models", str(pipeline / "models"), "--device", "cpu"]
    if case == "no folder":
        told, command = "missing", ["index", str(tmp_path / "none"), *models]
    elif case == "no index":
        told, command = "motionary index", ["search", "walk", "--in", str(tmp_path), *models]
    else:
        shutil.copytree(recordings, tmp_path / "copy")
        place = tmp_path / "copy" / ".motionary" / "index" / "index.json"
        place.write_text(json.dumps({**json.loads(place.read_text()), "judge_hash": "0"}))
        told, command = "another", ["search", "walk", "--in", str(tmp_path / "copy"), *models]
    assert main(command) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert told in error
    assert error.count("\n") == 1


def test_windows_cover_a_clip(pipeline):
    context = Corpus.open(pipeline / "data/corpus").context
    for frames in (4, 99, 100, 150, 151, 400, 1999):
        found = windows_of(frames, context)
        assert found[0][0] == 0
        assert all(length % context.unit == 0 for _, length in found)
        assert frames - sum(found[-1]) < context.unit
        assert all(b[0] - a[0] <= a[1] / 2 for a, b in itertools.pairwise(found))
    with pytest.raises(InputError, match="must last"):
        windows_of(3, context)


def test_duplicates_are_those_within_reach():
    rng = np.random.default_rng(0)
    outlines = rng.normal(size=(6, INSTANTS, 22, 3)).astype(np.float16)
    outlines[4] = outlines[1] + np.float16(0.01)  # sqrt(3) cm away
    outlines[5] = outlines[1]
    embeddings = rng.normal(size=(6, 8)).astype(np.float32)
    embeddings[3] = embeddings[0]
    clips, seconds = np.array([0, 1, 2, 3, 4, 1]), np.full(6, 5.0)
    pairs = near_duplicates(outlines, embeddings, clips, seconds)
    assert {(pair.first, pair.second) for pair in pairs} == {(0, 3), (1, 4), (4, 5)}
    assert next(p.joints for p in pairs if p.first == 1) == pytest.approx(0.01 * 3**0.5, abs=2e-3)
    seconds[4] = 9.0
    assert {(p.first, p.second) for p in near_duplicates(outlines, embeddings, clips, seconds)} == {(0, 3)}
