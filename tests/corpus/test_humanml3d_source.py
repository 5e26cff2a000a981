"""The released HumanML3D and KIT-ML layout, made here on a small scale."""

import numpy as np
import pytest
import yaml

from motionary.corpus.preprocess import preprocess
from motionary.corpus.released import HumanML3DSource
from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.evaluation.items import Items
from motionary.features import codec
from motionary.motion import Motion, Skeleton

TEXT = "a person walks forward.#a/DET person/NOUN walk/VERB forward/ADV#0.0#0.0\n"
PART = "someone # stops#someone/PRON stop/VERB#1.0#4.0\n"


@pytest.fixture
def release(tmp_path, motion_of):
    """Twelve motions; 000003 comes with its mirrored copy, 000005 only as features, 000007 with a timed caption. Joints
    and features of a release have equally many frames."""
    root = tmp_path / "HumanML3D"
    for folder in ("new_joints", "new_joint_vecs", "texts"):
        (root / folder).mkdir(parents=True)
    names = [f"{i:06d}" for i in range(12)] + ["M000003"]
    for i, name in enumerate(names):
        positions = motion_of(120, i)
        if name == "000005":
            skeleton = Skeleton.named("smpl22")
            features = codec("humanml3d", skeleton).encode(Motion(positions, 20.0, skeleton))
            np.save(root / "new_joint_vecs" / f"{name}.npy", features)
        else:
            np.save(root / "new_joints" / f"{name}.npy", positions)
        (root / "texts" / f"{name}.txt").write_text(TEXT + (PART if name == "000007" else ""))
    (root / "train.txt").write_text("\n".join([*names[:9], "M000003"]))
    (root / "val.txt").write_text("\n".join(names[9:10]))
    (root / "test.txt").write_text("\n".join(names[10:12]) + "\n")
    return root


def build(root, out, **changes):
    settings = {"source": "humanml3d", "roots": [str(root)], "split": "given", "workers": 1}
    settings |= {"cut": "released", "min_seconds": 2.0} | changes
    report = preprocess(settings, out, progress=False)
    return report, Corpus.open(out)


def test_the_release_keeps_its_splits_mirrors_and_segments(release, tmp_path):
    report, corpus = build(release, tmp_path / "out")
    assert report["problem_count"] == 0
    assert report["read"] == 13
    clips = corpus.clips
    by_split = {
        split: {name.split("/")[1][-6:] for name in clips.origin[clips.split == split]} for split in ("val", "test")
    }
    assert by_split == {"val": {"000009"}, "test": {"000010", "000011"}}
    twins = clips.id[clips.origin == "HumanML3D/000003"].tolist()
    assert sorted(twins) == ["HumanML3D/000003", "HumanML3D/M000003"]
    assert clips.mirrored[clips.id == "HumanML3D/M000003"].all()
    # Every other training motion gets the mirrored copy that the release does not bring.
    assert sorted(clips.id[clips.origin == "HumanML3D/000004"]) == ["HumanML3D/000004", "HumanML3D/000004@mirror"]
    timed = (clips.origin == "HumanML3D/000007") & ~clips.mirrored
    assert sorted(zip(clips.start[timed], clips.length[timed], strict=True)) == [(0.0, 120), (1.0, 60)]
    assert "someone # stops" in set(corpus.captions.text)


def test_tagged_words_of_the_release_are_the_normalized_caption(release, tmp_path):
    (release / "texts" / "000000.txt").write_text("a man ambles#a/DET man/NOUN strollish/VERB#0.0#0.0\n")
    _, corpus = build(release, tmp_path / "out", mirror=False)
    words = dict(zip(corpus.captions.text, corpus.captions.words, strict=True))
    assert words["a man ambles"] == ("a", "man", "strollish")


def test_features_stand_in_for_absent_joints(release, tmp_path, motion_of):
    _, corpus = build(release, tmp_path / "out")
    row = int(np.flatnonzero(corpus.clips.id == "HumanML3D/000005")[0])
    assert corpus.clips.length[row] == 116
    expected = motion_of(120, 5)
    height = corpus.motion(row).positions[:, 0, 1].mean()
    assert abs(height - expected[:, 0, 1].mean()) < 0.1


def test_a_release_without_its_texts_or_motions_is_one_error(release, tmp_path):
    (release / "texts").rename(release / "packed")
    with pytest.raises(InputError, match=r"/texts: missing: must hold the captions; unpack the release's texts\.zip"):
        build(release, tmp_path / "out")
    (release / "packed").rename(release / "texts")
    for name in ("new_joints", "new_joint_vecs"):
        (release / name).rename(release / f"no_{name}")
    with pytest.raises(InputError, match="/new_joints: missing: must hold the motions"):
        build(release, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("width", [262, 264])
def test_other_features_than_the_releases_are_refused(release, tmp_path, width):
    np.save(release / "new_joint_vecs" / "000005.npy", np.zeros((120, width), np.float32))
    report, _ = build(release, tmp_path / "out")
    assert report["problem_count"] == 1
    assert "(T, 263) or (T, 251) features" in report["problems"][0]["rule"]


def test_kit_ml_has_21_joints_in_millimetres_at_its_own_rate(tmp_path):
    root, skeleton = tmp_path / "KIT-ML", Skeleton.named("kit21")
    for folder in ("new_joints", "texts"):
        (root / folder).mkdir(parents=True)
    rest = np.zeros((21, 3))
    for joint, parent in enumerate(skeleton.parents):
        rest[joint] = skeleton.offsets[joint] + (rest[parent] if parent >= 0 else 0)
    for i in range(10):
        sway = 0.05 * np.sin(np.arange(50)[:, None, None] * 0.3 + np.arange(21)[:, None] + i)
        np.save(root / "new_joints" / f"{i:05d}.npy", 1000 * (rest + sway * (np.arange(21) > 0)[:, None]))
        (root / "texts" / f"{i:05d}.txt").write_text(TEXT)
    (root / "train.txt").write_text("\n".join(f"{i:05d}" for i in range(8)))
    (root / "test.txt").write_text("00008\n00009\n")
    report, corpus = build(root, tmp_path / "out", fps=12.5, skeleton="kit21")
    assert report["problem_count"] == 0
    assert corpus.context.dim == 251
    assert set(corpus.clips.length) == {48}
    tall = np.ptp(corpus.motion(0).positions[..., 1])
    assert 1.0 < tall < 2.2


def test_bad_lines_are_problems(release):
    (release / "texts" / "000000.txt").write_text("no hashes\na#a/DET#x#y\n#a/DET#0.0#0.0\n" + TEXT)
    (release / "texts" / "000001.txt").unlink()
    (release / "new_joints" / "000002.npy").unlink()
    with (release / "val.txt").open("a") as file:
        file.write("\n000000\n../secret\n")
    clips, problems = HumanML3DSource(release, "HumanML3D").clips()
    assert len(clips) == 12
    rules = [problem.rule for problem in problems]
    for part in ("duplicate", "bare name", "caption#", "seconds", "non-empty", "caption file", "absent"):
        assert sum(part in rule for rule in rules) == 1
    assert len(problems) == 7


def test_a_folder_without_split_files(tmp_path):
    (tmp_path / "new_joints").mkdir()
    (tmp_path / "texts").mkdir()
    with pytest.raises(InputError, match=r"train\.txt"):
        HumanML3DSource(tmp_path, "x").clips()


LENGTHS = (38, 39, 40, 41, 43, 44, 120, 196, 198, 199, 200, 201, 330)  # feature frames
SPANS = ((0.0, 0.0), (0.0, 2.0), (0.5, 2.49), (1.0, 4.0), (0.0, 9.98), (3.0, 99.0), (0.25, 1.9), (float("nan"), 1.0))


def made_release(root, joints, fps, lengths):
    """Every length in every split, each with its mirrored copy, and captions of every span."""
    (root / "new_joints").mkdir(parents=True)
    (root / "texts").mkdir()
    skeleton = Skeleton.named("smpl22" if joints == 22 else "kit21")
    rest = np.zeros((joints, 3))
    for joint, parent in enumerate(skeleton.parents):
        rest[joint] = skeleton.offsets[joint] + (rest[parent] if parent >= 0 else 0)
    for split in ("train", "val", "test"):
        names = []
        for number, frames in enumerate(lengths):
            sway = 0.05 * np.sin(np.arange(frames)[:, None, None] * 0.3 + np.arange(joints)[:, None] + number)
            for name in (f"{split}{number:03d}", f"M{split}{number:03d}"):
                np.save(root / "new_joints" / f"{name}.npy", rest + sway * (np.arange(joints) > 0)[:, None])
                lines = [f"text {n}#text/NOUN {n}/NUM#{a}#{b}" for n, (a, b) in enumerate(SPANS)]
                (root / "texts" / f"{name}.txt").write_text("\n".join(lines))
                names.append(name)
        (root / f"{split}.txt").write_text("\n".join(names))
    return root


def published(lengths, fps, least):
    """(length used, captions) of every item of a split by the released loaders' rule."""
    items = []
    for frames in lengths:
        if not least <= frames < 200:
            continue
        whole = [n for n, (a, b) in enumerate(SPANS) if a != a or a == b == 0]
        items.append((frames // 4 * 4, tuple(whole)))
        for n, (a, b) in enumerate(SPANS):
            count = len(range(frames)[int(a * fps) : int(b * fps)]) if n not in whole else 0
            if least <= count < 200:
                items.append((count // 4 * 4, (n,)))
    return sorted(items * 2)


@pytest.mark.parametrize(("preset", "joints", "fps", "least"), [("humanml3d", 22, 20.0, 40), ("kit", 21, 12.5, 24)])
def test_every_split_has_the_published_items(tmp_path, repository, preset, joints, fps, least):
    """Motions and segments as long as the released loaders take them, mirrored ones in each split, no unit lost."""
    lengths = (*LENGTHS, 23, 24, 27, 28)
    root = made_release(tmp_path / "release", joints, fps, lengths)
    settings = yaml.safe_load((repository / "conf" / "data" / f"{preset}.yaml").read_text())
    report = preprocess(settings | {"roots": [str(root)], "workers": 1}, tmp_path / "out", progress=False)
    corpus, expected = Corpus.open(tmp_path / "out"), published(lengths, fps, least)
    assert report["problem_count"] == 0
    assert not corpus.added.any()
    for split in ("train", "val", "test"):
        items = Items(corpus, split)
        texts = [tuple(int(sentence.text.split()[1]) for sentence in options) for options in items.references]
        found = sorted(zip([len(features) for features in items.features], texts, strict=True))
        assert found == expected
        assert corpus.clips.mirrored[items.rows].sum() * 2 == len(items)
    # Longer motions train what reads no text, whole.
    long = corpus.clips.origin == "release/train012"
    assert not any(len(corpus.captions_of(row)) for row in np.flatnonzero(long))
    assert corpus.clips.length[long & ~corpus.clips.mirrored].sum() >= 330 - 8


@pytest.mark.real
def test_the_released_sample_gives_its_released_features(shared_data, tmp_path):
    """Joints and features of the same released motion become the same windows."""
    made = []
    for name in ("new_joints", "new_joint_vecs"):
        root = tmp_path / name / "HumanML3D"
        (root / "texts").mkdir(parents=True)
        (root / name).symlink_to(shared_data / "humanml3d_sample" / name)
        (root / "texts" / "012314.txt").write_text(TEXT)
        (root / "train.txt").write_text("012314\n")
        made.append(build(root, tmp_path / f"{name}.out", mirror=False)[1])
    joints, features = (corpus.frames[: corpus.clips.length[0]] for corpus in made)
    count = min(len(joints), len(features)) - 80
    np.testing.assert_allclose(joints[:count], features[:count], atol=1e-2)
