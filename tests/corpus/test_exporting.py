"""Folders of motion written in the released layout, and read back from it."""

from __future__ import annotations

import csv
import json
import shutil
from itertools import pairwise

import numpy as np
import pytest

from motionary.cli import main
from motionary.corpus.config import RELEASED
from motionary.corpus.demo import demo_clips
from motionary.corpus.exporting import export_humanml3d
from motionary.corpus.released import HumanML3DSource
from motionary.corpus.windows import Rule
from motionary.corpus.workers import Recipe, encode_clip
from motionary.errors import InputError
from motionary.features import HumanML3D
from motionary.language import annotate, sentence_from_tokens
from motionary.motion import Motion, Skeleton, mirror

SPLITS = ("train", "val", "test")
CAPTIONS = [
    ["a person waves with the left hand", "someone is waving #1"],
    ["a man walks forward and turns right"],
    [],
]


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Three motions of 2.5, 4 and 13 s, of which the last has no caption, and one file that is none."""
    root = tmp_path_factory.mktemp("recordings")
    rows = []
    for k, (motion, _) in enumerate(demo_clips(3)):
        wanted = (50, 80, 260)[k]
        tiled = np.concatenate([motion.positions, motion.positions[::-1]] * 8)[:wanted]
        Motion(tiled, 20, motion.skeleton).save(root / f"{k}.npy")
        said = [{"text": text} for text in CAPTIONS[k]]
        rows.append({"motion": f"{k}.npy", "fps": 20, "captions": said})
    (root / "bad.npy").write_bytes(b"no array")
    rows.append({"motion": "bad.npy", "fps": 20})
    (root / "clips.jsonl").write_text("".join(f"{json.dumps(row)}\n" for row in rows), encoding="utf-8")
    return root


@pytest.fixture(scope="module")
def exported(recordings, tmp_path_factory):
    out = tmp_path_factory.mktemp("exported") / "humanml3d"
    counts = export_humanml3d(recordings, out, ratios=(0.4, 0.3, 0.3), workers=1, progress=False)
    return out, counts


@pytest.mark.parametrize("ratios", [(float("nan"), 1, 1), (-1, 1, 1), (0, 0, 0), (1, 0, float("inf")), (0.5, 0.5)])
def test_shares_are_shares(recordings, tmp_path, ratios):
    with pytest.raises(InputError, match=r"^ratios: .*must be three shares"):
        export_humanml3d(recordings, tmp_path / "out", ratios=ratios, workers=1, progress=False)
    assert not list(tmp_path.iterdir())


def names_of(folder, split):
    return (folder / f"{split}.txt").read_text().split()


def features_of(folder, name):
    return np.load(folder / "new_joint_vecs" / f"{name}.npy")


def test_every_motion_is_one_that_the_released_loaders_take(exported):
    out, counts = exported
    listed = names_of(out, "all")
    assert sorted(listed) == sorted(name for split in SPLITS for name in names_of(out, split))
    assert counts["motions"] == len(listed) == 2 * (1 + 1 + 2)  # the long one in two pieces, and all mirrored
    for name in listed:
        vectors, joints = features_of(out, name), np.load(out / "new_joints" / f"{name}.npy")
        assert vectors.dtype == joints.dtype == np.float32
        assert 40 <= len(vectors) < 200
        assert len(vectors) % 4 == 0
        assert vectors.shape[1:] == (263,)
        assert joints.shape == (len(vectors), 22, 3)
    assert names_of(out, "train")
    for split in SPLITS:
        assert {f"M{name}" for name in names_of(out, split) if name[0] != "M"} <= set(names_of(out, split))


def test_texts_carry_words_with_their_parts_of_speech(exported):
    out, counts = exported
    with (out / "index.csv").open() as file:
        rows = {row["new_name"]: row for row in csv.DictReader(file)}
    said = {name: (out / "texts" / f"{name}.txt").read_text().splitlines() for name in rows}
    assert counts["captions"] == sum(map(len, said.values())) == 6
    for name, row in rows.items():
        wanted = CAPTIONS[int(row["source_path"].removesuffix(".npy"))]
        assert len(said[name]) == len(wanted)
        for line, text in zip(said[name], wanted, strict=True):
            found, tokens, start, end = line.rsplit("#", 3)
            assert (float(start), float(end)) == (0, 0)
            assert sentence_from_tokens(found, tokens.split()) == annotate([found])[0]
            if name[0] != "M":
                assert found == text
    first = next(name for name, row in rows.items() if row["source_path"] == "0.npy" and name[0] != "M")
    second = next(name for name, row in rows.items() if row["source_path"] == "1.npy" and name[0] != "M")
    assert said[second][0].split("#")[1].startswith("a/DET man/NOUN walk/VERB forward/ADV and/CCONJ turn/VERB")
    assert said[f"M{first}"][0].split("#")[0] == "a person waves with the right hand"


def test_a_copy_is_the_mirrored_motion(exported):
    out, _ = exported
    codec = HumanML3D(Skeleton.named("smpl22"))
    for name in ("000000", "000001"):
        own, copy = (codec.decode(features_of(out, n)) for n in (name, f"M{name}"))
        seen = codec.decode(codec.encode(mirror(own))).positions
        assert np.linalg.norm(copy.positions[: len(seen)] - seen, axis=-1).mean() < 0.005


def test_statistics_follow_the_released_rule(exported):
    """Over the frames of all files; the deviation averaged in each group, not yet divided by 5."""
    out, _ = exported
    frames = np.concatenate([features_of(out, name) for name in names_of(out, "all")]).astype(np.float64)
    np.testing.assert_allclose(np.load(out / "Mean.npy"), frames.mean(0), atol=1e-5)
    deviation, found = frames.std(0), np.load(out / "Std.npy")
    edges = (0, 1, 3, 4, 4 + 63, 4 + 63 + 126, 4 + 63 + 126 + 66, 263)
    for first, last in pairwise(edges):
        np.testing.assert_allclose(found[first:last], deviation[first:last].mean(), rtol=1e-4)


def read_back(folder):
    clips, problems = HumanML3DSource(folder, "again").clips()
    assert not problems
    recipe = Recipe("smpl22", "humanml3d", Rule(20.0, 2.0, 10.0, 4, RELEASED), False)
    return {clip.id.removeprefix("again/"): (clip, encode_clip(clip, "test", recipe)) for clip in clips}


def test_reading_it_back_gives_the_same_clips(exported):
    out, _ = exported
    again = read_back(out)
    assert sorted(again) == sorted(names_of(out, "all"))
    for name, (clip, encoded) in again.items():
        assert not encoded.problems
        assert name in names_of(out, clip.split)
        assert clip.mirrored == (name[0] == "M")
        assert not clip.mirrors
        ((window, features, _),) = encoded.windows
        wanted = features_of(out, name)
        assert len(features) == len(wanted)
        assert [c.text for c in window.captions] == [
            line.rsplit("#", 3)[0] for line in (out / "texts" / f"{name}.txt").read_text().splitlines()
        ]
        # A mirrored body is not quite smpl22, whose sides differ: it takes that shape when it is read.
        found, own = (HumanML3D(Skeleton.named("smpl22")).decode(x).positions for x in (features, wanted))
        assert np.linalg.norm(found - own, axis=-1).max() < (0.02 if clip.mirrored else 1e-5)


def test_the_shell_says_what_it_left_out(recordings, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["export", "humanml3d", str(recordings), str(out), "--no-mirror", "--json"]) == 0
    told = capsys.readouterr()
    row = json.loads(told.out)
    assert row["motions"] == 4
    assert row["problems"] == 1
    assert told.err.count("warning: ") == 1
    assert "bad.npy" in told.err
    assert not list((out / "texts").glob("M*"))
    assert main(["export", "humanml3d", str(recordings), str(out), "--ratios", "0.4", "0.3", "0.3", "--force"]) == 0
    counts = {split: len(names_of(out, split)) for split in SPLITS}
    shares = ", ".join(f"{split} {count}" for split, count in counts.items())
    told = f"{out}: 8 motions (mirrored copies among them) of 4 clips, 6 captions; split by clip: {shares}\n"
    assert capsys.readouterr().out == told
    assert main(["export", "humanml3d", str(out), str(tmp_path / "again"), "--no-mirror"]) == 0
    assert "; split as the folder gives it: " in capsys.readouterr().out


def test_what_stands_in_the_way_is_kept(recordings, tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="use force=True"):
        export_humanml3d(recordings, tmp_path, workers=1, progress=False)
    with pytest.raises(InputError, match="another folder"):
        export_humanml3d(recordings, recordings.parent, force=True)
    assert (tmp_path / "mine.txt").read_text() == "mine"
    assert (recordings / "clips.jsonl").exists()
    empty = tmp_path / "few"
    empty.mkdir()
    shutil.copy(recordings / "bad.npy", empty)
    with pytest.raises(InputError, match="no usable clip"):
        export_humanml3d(empty, tmp_path / "none", workers=1, progress=False)
    assert not (tmp_path / "none").exists()


@pytest.mark.real
def test_the_released_sample_comes_out_as_it_went_in(shared_data, tmp_path):
    """Its joints with 170 frames: 42 whole units, to the features that were published with them."""
    sample = shared_data / "humanml3d_sample"
    root = tmp_path / "sample"
    shutil.copytree(sample, root)
    (root / "texts").mkdir()
    (root / "texts" / "012314.txt").write_text("a person walks.#a/DET person/NOUN walk/VERB#0.0#0.0\n")
    for split in SPLITS:
        (root / f"{split}.txt").write_text("012314\n" if split == "val" else "")
    counts = export_humanml3d(root, tmp_path / "out", workers=1, progress=False)
    assert (counts["motions"], counts["val"], counts["captions"]) == (2, 2, 2)
    found, published = (np.load(p / "new_joint_vecs" / n) for p, n in
                        ((tmp_path / "out", "000000.npy"), (sample, "012314.npy")))  # fmt: skip
    assert len(found) == 168
    # Towards the end the smoothed facing sees two frames less than the published one did.
    np.testing.assert_allclose(found[:120], published[:120], atol=2e-3)
    np.testing.assert_allclose(found, published[:168], atol=0.05)
    line = (tmp_path / "out" / "texts" / "000000.txt").read_text()
    assert line == "a person walks.#a/DET person/NOUN walk/VERB#0.0#0.0\n"
