"""A file that tells little is read as the others of its rig; one that tells much is not, and a few are too few."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from postures import POSTURES, person, points, written

from motionary.archive.indexing import index_folder
from motionary.corpus.config import DataConfig
from motionary.corpus.demo import demo_clip
from motionary.corpus.originals import Originals
from motionary.corpus.preprocess import preprocess
from motionary.corpus.shared_rigs import pooled, with_shared_rigs
from motionary.corpus.sources import FolderSource
from motionary.corpus.store import Corpus
from motionary.dictionary.places import PACKAGED


def z_up(points: np.ndarray) -> np.ndarray:
    """(x, y, z) of y up -> the same with z up."""
    return points[..., [0, 2, 1]] * np.array([1.0, -1, 1])


def leaning(degrees: float) -> np.ndarray:
    """A second of somebody who hangs askew around a pelvis that stays at the origin, z up: hardly any evidence."""
    points = demo_clip(0)[0].positions[:20].astype(float)
    turn, (c, s) = np.eye(3), (np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees)))
    turn[1:, 1:] = [[c, -s], [s, c]]
    return z_up(points - points[:, :1]) @ turn.T


def folder(path: Path, walkers: int, others: dict[str, np.ndarray]) -> Path:
    path.mkdir()
    for i in range(walkers):
        np.save(path / f"walker{i}.npy", z_up(demo_clip(i)[0].positions))
    for name, joints in others.items():
        np.save(path / f"{name}.npy", joints)
    return path


def axes(root: Path, shared: bool = True) -> dict[str, str]:
    """Which axis is up, by file."""
    clips = FolderSource(root, "suit").clips()[0]
    clips = with_shared_rigs(clips) if shared else clips
    found = [clip.load(clip)[1] for clip in clips]
    return {clip.id.split("/")[1]: clip.reading.up for clip in found if clip.reading}


def test_a_file_that_tells_little_follows_the_others(tmp_path):
    root = folder(tmp_path / "suit", 4, {"askew": leaning(60), "back": leaning(-60)})
    alone = axes(root, shared=False)
    assert (alone["askew"], alone["back"], alone["walker0"]) == ("-y", "y", "z")
    assert set(axes(root).values()) == {"z"}
    clips = with_shared_rigs(FolderSource(root, "suit").clips()[0])
    askew = next(clip for clip in clips if clip.id == "suit/askew")
    reading = askew.load(askew)[1].reading
    assert reading is not None
    assert "up: took z as other files of its rig have it, where this one by itself would be -y" in reading.notes[0]
    assert "--up" in reading.notes[0]


def test_a_file_that_tells_much_stays(tmp_path):
    root = folder(tmp_path / "suit", 4, {"other": demo_clip(7)[0].positions})
    assert axes(root) == {**{f"walker{i}": "z" for i in range(4)}, "other": "y"}


def test_a_folder_that_mixes_axes_decides_nothing(tmp_path):
    root = folder(tmp_path / "suit", 4, {"askew": leaning(60)})
    for i in range(4, 8):
        np.save(root / f"walker{i}.npy", demo_clip(i)[0].positions)
    assert axes(root)["askew"] == axes(root, shared=False)["askew"] == "-y"


def test_recorded_frames_are_read_as_the_corpus_was(tmp_path):
    """Who lies on the belly looks, alone, as if on the back in a world that is z up; the corpus is at another rate."""
    name = "lies on the belly"
    for posture in POSTURES:
        (tmp_path / f"{posture}.bvh").write_text(written(*person(posture), "y", "z"))
    assert axes(tmp_path, shared=False)[name] == "z"
    values = {
        "source": "folder",
        "roots": [str(tmp_path)],
        "workers": 1,
        "min_seconds": 1.0,
        "fps": 10,
        "mirror": False,
    }
    config = DataConfig.from_mapping(values)
    preprocess(config, tmp_path / "out", progress=False)
    corpus = Corpus.open(tmp_path / "out")
    rows = np.flatnonzero(~corpus.clips.mirrored)
    row = next(i for i in rows if corpus.clips.origin[i].endswith(name))
    tall = np.ptp(points(*person(name))[..., 1])
    for motion in (corpus.motion(row), Originals(corpus, config, tmp_path).motion(row)):
        assert motion is not None
        assert abs(np.ptp(motion.positions[..., 1]) - tall) < 0.05


def test_what_the_user_says_stays(tmp_path):
    root = folder(tmp_path / "suit", 4, {"askew": leaning(60)})
    (root / "clips.jsonl").write_text(
        "".join(
            json.dumps({"motion": f.name, "fps": 20, **({"up": "x"} if f.stem == "askew" else {})}) + "\n"
            for f in sorted(root.glob("*.npy"))
        )
    )
    assert axes(root)["askew"] == "x"


def test_two_files_are_no_majority_and_another_rig_is_not_asked(tmp_path):
    few = folder(tmp_path / "few", 1, {"askew": leaning(60)})
    assert axes(few)["askew"] == "-y"
    apart = folder(tmp_path / "apart", 4, {})
    np.save(apart / "askew.npy", np.concatenate([leaning(60), np.zeros((20, 2, 3))], 1)[:, :22])
    np.save(apart / "fewer.npy", leaning(60)[:, :21])  # kit21, by its joints: a rig of its own
    clips = {clip.id: clip for clip in with_shared_rigs(FolderSource(apart, "suit").clips()[0])}
    assert clips["suit/fewer"].load.options is None
    assert clips["suit/askew"].load.options is not None


def test_files_that_cannot_be_read_count_for_nothing(tmp_path):
    root = folder(tmp_path / "suit", 3, {"askew": leaning(60)})
    (root / "broken.npy").write_bytes((root / "askew.npy").read_bytes()[:200])
    (root / "broken.bvh").write_text("HIERARCHY\nROOT a\n")
    clips = {clip.id: clip for clip in with_shared_rigs(FolderSource(root, "suit").clips()[0])}
    askew = clips["suit/askew"]
    reading = askew.load(askew)[1].reading
    assert reading is not None
    assert reading.up == "z"


def test_pooled_evidence_is_a_sum_with_a_limit():
    seen = [{"up": {"y": 0.0, "z": -1.2}, "unit": {"m": 0.0, "cm": -9.0}}, {"up": {"y": -4.0, "z": 0.0}}]
    # y: -4, z: -1.2; relative to the best -2.8, rounded to whole numbers; cm lies beyond the limit.
    assert pooled(seen) == {"up": {"y": -3.0, "z": 0.0}, "unit": {"m": 0.0, "cm": -5.0}}


def test_a_corpus_is_read_so(tmp_path):
    root = folder(tmp_path / "suit", 4, {"askew": leaning(60)})
    settings = {"source": "folder", "roots": [str(root)], "workers": 1, "min_seconds": 0.5}
    report = preprocess(settings, tmp_path / "corpus", progress=False)
    told = report["roots"]["suit"]["reading"]
    assert told["up"] == {"z": 5}
    assert any("askew" in note and "other files of its rig" in note for note in told["notes"])


def test_an_archive_is_read_so(tmp_path):
    root = folder(tmp_path / "suit", 4, {"askew": np.concatenate([leaning(60)] * 3)})
    index_folder(root, PACKAGED, workers=1, progress=False)
    rows = [row for row in stored_rows(root) if row.file == "askew.npy"]
    assert [row.up for row in rows] == ["z"]


def stored_rows(root: Path) -> list:
    from motionary.archive.indexing import HIDDEN
    from motionary.archive.parts import stored

    (parts,) = (root / HIDDEN).glob("parts-*")
    return [row for _, part in stored(parts) for row in part.clips]
