"""A corpus built from small folders: contents, statistics, splits, workers, and every kind of bad clip."""

import json
from pathlib import Path

import numpy as np
import pytest

from motionary.corpus.preprocess import preprocess
from motionary.corpus.store import Corpus
from motionary.corpus.workers import without_bind_pose
from motionary.errors import InputError
from motionary.features import codec
from motionary.formats import read_motion
from motionary.motion import Motion, Skeleton, canonicalize, retarget

SMPL = Skeleton.named("smpl22")


def build(root, out, **changes):
    settings = {"source": "folder", "roots": [str(root)], "workers": 1} | changes
    return preprocess(settings, out, progress=False)


def line(name, *texts, **labels):
    return {"motion": f"motions/{name}.npy", "fps": 20, "captions": [{"text": text} for text in texts]} | labels


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_windows_of_one_clip_share_a_split_and_only_training_is_mirrored(corpus):
    clips = corpus.clips
    for origin in np.unique(clips.origin):
        assert len(set(clips.split[clips.origin == origin])) == 1
    assert set(clips.split[clips.mirrored]) == {"train"}
    train = clips.split == "train"
    assert clips.mirrored[train].sum() == (~clips.mirrored[train]).sum()
    assert set(clips.split) == {"train", "val", "test"}


def test_mapping_json_names_the_joints_of_a_folder_whose_rig_is_not_known(tmp_path, motion_of):
    uneven = SMPL.offsets.copy()  # legs that are no twins: the tree does not tell either
    uneven[SMPL.joints.index("left_knee")] *= 2
    rig = Skeleton.from_rig("numbered", [f"bone{i}" for i in range(22)], SMPL.parents, uneven)
    for folder, skeleton in (("known/rig", SMPL.with_offsets(uneven)), ("unknown/rig", rig)):
        (tmp_path / folder).mkdir(parents=True)
        for i in range(4):
            Motion(motion_of(80, i), 20, skeleton).save(tmp_path / folder / f"{i}.npz")
    build(tmp_path / "known/rig", tmp_path / "first")
    with pytest.raises(InputError, match=r"mapping\.json in a data folder"):
        build(tmp_path / "unknown/rig", tmp_path / "second")
    mapping = tmp_path / "unknown/rig/mapping.json"
    mapping.write_text(json.dumps(dict(zip(SMPL.joints, rig.joints, strict=True))))
    report = build(tmp_path / "unknown/rig", tmp_path / "second")
    assert (report["read"], report["problem_count"]) == (4, 0)
    np.testing.assert_array_equal(Corpus.open(tmp_path / "first").frames, Corpus.open(tmp_path / "second").frames)
    mapping.write_text('{"tail": "bone1"}')
    with pytest.raises(InputError, match=r"mapping\.json: tail: roles are head, "):
        build(tmp_path / "unknown/rig", tmp_path / "third")


def test_windows_tile_the_frames_and_are_whole_units(corpus):
    clips = corpus.clips
    np.testing.assert_array_equal(clips.offset, np.cumsum(clips.length) - clips.length)
    assert clips.offset[-1] + clips.length[-1] == len(corpus.frames)
    assert (clips.length % corpus.context.unit == 0).all()
    assert clips.length.min() >= 16
    assert clips.length.max() <= corpus.context.max_frames
    assert np.isfinite(corpus.frames).all()


def test_statistics_equal_a_direct_computation_on_training_frames(corpus):
    rows = corpus.rows("train")
    frames = np.concatenate([corpus.features(i) for i in rows]).astype(np.float64)
    context = corpus.context
    np.testing.assert_allclose(context.mean, frames.mean(0), atol=1e-6)
    slices = codec("humanml3d", SMPL).slices
    for name, part in slices.items():
        scale = 5 if name.startswith("root_") or name == "contacts" else 1
        np.testing.assert_allclose(context.std[part], frames.std(0)[part].mean() / scale, rtol=1e-5)
    np.testing.assert_array_equal(context.mean, np.load(corpus.folder / "mean.npy"))


def test_a_window_holds_the_features_of_its_source(corpus, some_clips):
    row = int(np.flatnonzero((corpus.clips.origin == "some/clip03") & ~corpus.clips.mirrored)[0])
    motion = retarget(read_motion(some_clips / "motions/clip03.npy"), SMPL)
    first = round(corpus.clips.start[row] * 20)
    motion = canonicalize(motion.crop(first, first + corpus.clips.length[row] + 1))
    np.testing.assert_allclose(corpus.features(row), codec("humanml3d", SMPL).encode(motion), atol=1e-6)
    assert corpus.motion(row).frames == corpus.clips.length[row]


def test_mirrored_copies_have_mirrored_captions_and_motion(corpus):
    row = int(np.flatnonzero(corpus.clips.mirrored & (np.diff(corpus.caption_start) > 0))[0])
    original = int(np.flatnonzero(corpus.clips.id == corpus.clips.id[row].removesuffix("@mirror"))[0])
    pairs = zip(corpus.captions_of(original), corpus.captions_of(row), strict=True)
    for before, after in pairs:
        assert corpus.captions.text[after] == corpus.captions.text[before].replace("left", "right")
    turned = corpus.features(row)[:, 0] + corpus.features(original)[:, 0]
    np.testing.assert_allclose(turned, 0, atol=1e-3)


def test_keys_number_distinct_normalized_texts(corpus):
    captions = corpus.captions
    texts = [" ".join(words) for words in captions.words]
    assert len(set(zip(texts, captions.key.tolist(), strict=True))) == len(set(texts)) == len(set(captions.key))
    assert all(len(words) == len(tags) for words, tags in zip(captions.words, captions.tags, strict=True))


def test_the_vocabulary_knows_every_training_word(corpus):
    trained = np.isin(corpus.captions.clip, corpus.rows("train"))
    words = {word for row in corpus.captions.words[trained] for word in row}
    assert words <= set(corpus.context.vocabulary.words)


def test_rows_by_split_captions_and_group(corpus):
    assert sum(len(corpus.rows(split)) for split in ("train", "val", "test")) == len(corpus)
    assert len(corpus.rows("train", True)) + len(corpus.rows("train", False)) == len(corpus.rows("train"))
    assert len(corpus.rows(captioned=False)) > 0
    np.testing.assert_array_equal(corpus.rows(group="some"), np.arange(len(corpus)))
    with pytest.raises(InputError, match="split"):
        corpus.rows("training")


def test_labels(corpus):
    assert corpus.context.styles == ("happy", "old")
    assert corpus.context.actions == ("bow", "run", "walk")
    names = np.array([*corpus.context.styles, ""])
    np.testing.assert_array_equal(names[corpus.style_ids], corpus.clips.style)


def test_any_number_of_workers_gives_the_same_bytes(some_clips, corpus, tmp_path):
    build(some_clips, tmp_path / "two", workers=2)
    assert files(tmp_path / "two") == files(corpus.folder)


def test_long_clips_are_cut_and_short_ones_dropped(tmp_path, folder_of):
    lines = [line(f"c{i}", "a person walks") for i in range(12)]
    lines[1]["action"], lines[2]["action"] = "walk", "bow"
    lengths = {"motions/c0.npy": 18, "motions/c1.npy": 420, "motions/c2.npy": 30}
    lengths |= {f"motions/c{i}.npy": 60 for i in range(3, 12)}
    report = build(folder_of(tmp_path / "x", lines, lengths), tmp_path / "out", mirror=False)
    assert report["dropped"] == {"segment too short": 1}
    assert report["short"] == {"below_seconds": 2.0, "kept": {"bow": 1}, "dropped": {"no label": 1}}
    assert report["read"] == 12
    assert report["kept"] == 11
    corpus = Corpus.open(tmp_path / "out")
    long = np.flatnonzero(corpus.clips.origin == "x/c1")
    assert sum(len(corpus.captions_of(i)) for i in long) == 1
    rest = corpus.clips.length[long][1:].sum() / 20 / 60
    assert report["long"] == {"cropped": 1, "rest_windows": len(long) - 1, "rest_minutes": round(rest, 3)}
    assert report["total"]["windows"] == len(corpus) == 10 + len(long)
    assert sum(report["splits"][split].get("windows", 0) for split in report["splits"]) == len(corpus)
    assert sum(report["caption_sources"]["no source"].values()) == len(corpus.captions) == 11


def test_windows_below_two_seconds_are_the_papers_choice(tmp_path, folder_of):
    lines = [line(f"c{i}", "a person walks") for i in range(10)]
    root = folder_of(tmp_path / "x", lines, {"motions/c0.npy": 30})
    assert build(root, tmp_path / "out", min_seconds=2.0)["dropped"] == {"segment too short": 1}


def test_captions_keep_their_source_and_its_weight(tmp_path, folder_of):
    lines = [line(f"c{i}") for i in range(10)]
    for number, one in enumerate(lines):
        one["captions"] = [{"text": f"text {number}", "source": ("people", "index")[number % 2]}]
    root = folder_of(tmp_path / "x", lines)
    report = build(root, tmp_path / "out", source_weights={"people": 3.0}, mirror=False)
    captions = Corpus.open(tmp_path / "out").captions
    np.testing.assert_array_equal(captions.weight, np.where(captions.source == "people", 3, 1))
    assert {source: sum(counts.values()) for source, counts in report["caption_sources"].items()} == {
        "index": 5,
        "people": 5,
    }


def test_captions_that_weigh_nothing_are_left_out(tmp_path, folder_of):
    lines = [line(f"c{i}") for i in range(10)]
    for number, one in enumerate(lines):
        one["captions"] = [{"text": f"text {number}", "source": ("people", "index")[number % 2]}]
    root = folder_of(tmp_path / "x", lines)
    report = build(root, tmp_path / "out", source_weights={"people": 0}, mirror=False)
    corpus = Corpus.open(tmp_path / "out")
    assert set(corpus.captions.source) == {"index"}
    assert len(corpus) == 10  # the motions stay
    assert report["total"]["captioned"] == 5


def bad_files(folder: Path) -> dict[str, str]:
    """File name -> part of the rule that its problem must state."""
    good = np.zeros((60, 22, 3), np.float32)
    nan, infinite = good.copy(), good.copy()
    nan[5, 3, 1], infinite[0, 0, 0] = np.nan, np.inf
    np.save(folder / "nan.npy", nan)
    np.save(folder / "infinite.npy", infinite)
    np.save(folder / "shape.npy", np.zeros((60, 9, 3)))
    np.save(folder / "objects.npy", np.array([{"a": 1}]), allow_pickle=True)
    (folder / "broken.npy").write_bytes(b"\x93NUMPY\x01\x00v\x00{'descr'")
    (folder / "empty.npy").write_bytes(b"")
    (folder / "cut.bvh").write_text("HIERARCHY\nROOT Hips\n{\n  OFFSET 0 0 0\n")
    names = ("nan.npy", "infinite.npy", "shape.npy", "objects.npy", "broken.npy", "empty.npy", "cut.bvh")
    return {name: name for name in names}


def test_bad_clips_are_skipped_and_named(tmp_path, folder_of):
    root = folder_of(tmp_path / "x", [line(f"c{i}", "a person walks") for i in range(10)])
    names = bad_files(root / "motions")
    with (root / "clips.jsonl").open("a") as listing:
        for name in names:
            listing.write(json.dumps({"motion": f"motions/{name}", "fps": 20}) + "\n")
    report = build(root, tmp_path / "out")
    assert report["kept"] == 10
    assert report["dropped"] == {"unusable clip": len(names)}
    assert report["problem_count"] == len(names)
    for problem, name in zip(sorted(p["file"] for p in report["problems"]), sorted(names), strict=True):
        assert f"clips.jsonl:{11 + list(names).index(name)}" in problem or name in problem
    assert all(problem["rule"] for problem in report["problems"])
    with pytest.raises(InputError):
        build(root, tmp_path / "strict", strict=True)
    assert not (tmp_path / "strict").exists()


def test_a_caption_outside_its_clip_is_dropped_and_strict_stops(tmp_path, folder_of):
    lines = [line(f"c{i}", "a person walks") for i in range(10)]
    lines[4]["captions"].append({"text": "a person runs", "start": 1.0, "end": 9.0})
    root = folder_of(tmp_path / "x", lines)
    report = build(root, tmp_path / "out", mirror=False)
    assert report["captions"] == 10
    assert "clips.jsonl:5" in report["problems"][0]["file"]
    with pytest.raises(InputError, match="inside the clip"):
        build(root, tmp_path / "strict", strict=True)


def test_a_root_that_teleports_is_dropped(tmp_path, folder_of, motion_of):
    root = folder_of(tmp_path / "x", [line(f"c{i}", "a person walks") for i in range(10)])
    motion = motion_of(60)
    motion[30:] += 4
    np.save(root / "motions/c3.npy", motion)
    assert build(root, tmp_path / "out")["dropped"] == {"root jumps": 1}


def test_no_usable_clip_leaves_nothing_and_keeps_what_was_there(tmp_path, folder_of):
    root = folder_of(tmp_path / "x", [line("c", "a person walks")], {"motions/c.npy": 18})
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "kept.txt").write_text("before")
    with pytest.raises(InputError, match="no usable clip"):
        build(root, tmp_path / "out")
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["out", "x"]
    assert (tmp_path / "out" / "kept.txt").read_text() == "before"
    folder_of(tmp_path / "x", [line("gone")], {"motions/gone.npy": 0})
    with pytest.raises(InputError, match="no clip"):
        build(root, tmp_path / "out")


def test_a_finished_corpus_replaces_the_old_one(tmp_path, folder_of):
    root = folder_of(tmp_path / "x", [line(f"c{i}", "a person walks") for i in range(10)])
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old.txt").write_text("before")
    build(root, tmp_path / "out")
    assert not (tmp_path / "out" / "old.txt").exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "x"]
    with pytest.raises(InputError, match="preprocess"):
        Corpus.open(tmp_path / "x")


def test_clips_without_any_caption(tmp_path, folder_of):
    root = folder_of(tmp_path / "x", [line(f"c{i}") for i in range(20)])
    (root / "clips.jsonl").unlink()
    build(root, tmp_path / "out")
    corpus = Corpus.open(tmp_path / "out")
    assert len(corpus.captions) == 0
    assert len(corpus.rows("train", captioned=True)) == 0
    assert corpus.clips.id[0] == "x/c0"


def test_another_rate_and_the_context_round_trip(tmp_path, folder_of):
    root = folder_of(tmp_path / "x", [line(f"c{i}", "a person walks") for i in range(10)])
    build(root, tmp_path / "out", fps=12.5)
    corpus = Corpus.open(tmp_path / "out")
    assert corpus.context.max_frames == 124
    assert set(corpus.clips.length) == {36}
    again = type(corpus.context).from_json(json.loads(json.dumps(corpus.context.to_json())))
    np.testing.assert_array_equal(again.std, corpus.context.std)
    assert again.skeleton == corpus.context.skeleton
    assert again.vocabulary.words == corpus.context.vocabulary.words


def t_pose() -> np.ndarray:
    """(22, 3) the rest pose of smpl22, feet on the ground."""
    rest = np.zeros((22, 3))
    for joint, parent in enumerate(SMPL.parents[1:], 1):
        rest[joint] = rest[parent] + SMPL.offsets[joint]
    return rest - [0, rest[:, 1].min(), 0]


def hanging(positions: np.ndarray) -> np.ndarray:
    """The same motion with its arms down."""
    positions = positions.copy()
    for shoulder, elbow, wrist in ((16, 18, 20), (17, 19, 21)):
        positions[:, elbow] = positions[:, shoulder] + [0, -0.26, 0]
        positions[:, wrist] = positions[:, shoulder] + [0, -0.5, 0.1]
    return positions


def test_a_leading_bind_pose_is_replaced(motion_of):
    positions = hanging(motion_of(120))
    shown = positions.copy()
    shown[0] = t_pose()
    fixed = without_bind_pose(Motion(shown, 20.0, SMPL)).positions
    np.testing.assert_array_equal(fixed[1:], positions[1:])
    np.testing.assert_array_equal(fixed[0], positions[1])
    untouched = Motion(positions, 20.0, SMPL)
    assert without_bind_pose(untouched) is untouched


def test_a_quick_start_is_no_bind_pose(motion_of):
    """Neither hands that fly up in the first step, nor a T-pose out of which the motion goes on quickly."""
    quick = hanging(motion_of(120))
    quick[0, 16:22] += 0.5
    swing = np.repeat(t_pose()[None], 30, axis=0)
    for t in range(30):
        swing[t, 16:22, 1] += 0.2 * min(t, 5)
    for positions in (quick, swing):
        motion = Motion(positions, 20.0, SMPL)
        assert without_bind_pose(motion) is motion


@pytest.mark.parametrize("fps", [1.0, 0.6, 5.0])
def test_slow_rates_have_beginnings_too(motion_of, fps):
    motion = Motion(motion_of(3), fps, SMPL)
    assert without_bind_pose(motion) is motion


BIND_POSES = {
    "captioned": ["07_12", *(f"135_{i:02d}" for i in (3, 4, 5, 6, 7, 9, 10, 11))]
    + [f"60_{i:02d}" for i in (1, 2, 3, 4, 5, 6, 7, 9, 10, 11, 12, 13, 14, 15)]
    + [f"61_{i:02d}" for i in (1, 2, 3, 4, 5, 6, 7, 9, 10, 11, 12, 13, 14, 15)]
    + [f"94_{i:02d}" for i in (4, 6, 7, 8, 13, 14, 15)],
    "styled": [],
    "cmu": [],
}


@pytest.mark.real
@pytest.mark.parametrize("folder", BIND_POSES)
def test_real_bind_poses_go_and_real_beginnings_stay(shared_data, folder):
    """Thirty clips of `raise-up-both-hands`, active, begin quickly: none of them loses its beginning."""
    found = []
    for path in sorted((shared_data / folder / "motions").glob("*.npy")):
        motion = Motion(np.load(path), 20.0, SMPL)
        if without_bind_pose(motion) is not motion:
            found.append(path.stem)
    assert sorted(found) == sorted(BIND_POSES[folder])


@pytest.mark.real
def test_real_clips(shared_data, tmp_path):
    """Thirty clips of each of two real folders, and all four rigs of raw BVH."""
    roots = []
    for name in ("captioned", "styled"):
        lines = (shared_data / name / "clips.jsonl").read_text().splitlines()[::90][:30]
        (tmp_path / name).mkdir()
        (tmp_path / name / "motions").symlink_to(shared_data / name / "motions")
        (tmp_path / name / "clips.jsonl").write_text("\n".join(lines))
        roots.append(str(tmp_path / name))
    lines = (shared_data / "bvh" / "clips.jsonl").read_text().splitlines()
    rigs = {json.loads(text)["skeleton"]: text for text in lines if '"end": 1.' not in text and '"end": 0.' not in text}
    (tmp_path / "bvh").mkdir()
    (tmp_path / "bvh" / "motions").symlink_to(shared_data / "bvh" / "motions")
    (tmp_path / "bvh" / "clips.jsonl").write_text("\n".join(rigs.values()))
    report = build(tmp_path / "bvh", tmp_path / "out", roots=[*roots, str(tmp_path / "bvh")])
    assert report["problem_count"] == 0
    corpus = Corpus.open(tmp_path / "out")
    assert set(np.unique(corpus.clips.group)) == {"captioned", "styled", "bvh"}
    assert np.isfinite(corpus.frames).all()
    # A body 1.4 to 2 m tall that stands on the floor, whatever the rig and its unit.
    for row in corpus.rows(group="bvh"):
        positions = corpus.motion(row).positions
        assert 1.2 < positions[..., 1].max() < 2.6
        assert positions[..., 1].min() > -0.1
