"""A bundle answers as the run that it was made of does, says what it is, and is what an installed package opens."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load_file
from shell import call

import motionary
from motionary.bench.asked import asked
from motionary.bench.recognized import recognized
from motionary.corpus.demo import demo_clip
from motionary.corpus.store import Corpus
from motionary.dictionary import places
from motionary.errors import InputError
from motionary.pretrained import make_bundle, making
from motionary.pretrained.fixed_sample import FixedSample
from motionary.systems.judges.corpus_search import Index
from motionary.systems.judges.judge import Judge
from motionary.systems.registry import TEXT_TO_MOTION

TEXTS = ["a person walks forward", "somebody waves with the left hand"]
unpickled: list[str] = []
listening: list[bool] = []


def listen(event: str, _) -> None:
    """Keeps what is unpickled while somebody listens; a hook of the interpreter stays for good."""
    if listening and event == "pickle.find_class":
        unpickled.append(event)


@pytest.fixture(scope="module")
def bundle(pipeline, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("bundle") / "bundle"
    make_bundle(pipeline / "models", out, generator="text2token")
    return out


@pytest.fixture(scope="module")
def packed(bundle):
    return motionary.load(bundle, "cpu")


@pytest.fixture(scope="module")
def run(pipeline):
    return motionary.load(pipeline / "models", "cpu")


def test_it_holds_what_answers_and_what_that_asks_for(bundle, packed):
    manifest = json.loads((bundle / "bundle.json").read_text())
    assert set(packed.systems) == set(manifest["systems"]) == {
        "text2token", "tokenizer", "text2length", "motion2text", "evaluator", "joint_evaluator", "retrieval"
    }  # fmt: skip
    assert packed.offering(TEXT_TO_MOTION) == ("text2token",)
    files = {file.relative_to(bundle).as_posix() for file in bundle.rglob("*") if file.is_file()}
    assert {Path(name).suffix for name in files} == {".json", ".safetensors", ".npy", ".npz", ".parquet", ".md"}
    assert not any("frames" in name for name in files)
    assert sum((bundle / name).stat().st_size for name in files) < making.MOST_BYTES


def test_search_in_the_space_of_the_small_judge_leaves_the_large_one_out(pipeline, run, tmp_path):
    project = tmp_path / "project"
    shutil.copytree(pipeline, project)
    corpus = Corpus.open(project / "data/corpus")
    judge = Judge(project / "models/joint_evaluator")
    motions = judge.motions([corpus.features(i) for i in range(len(corpus))])
    Index(motions, judge.hash, "joint_evaluator").save(project / "models/retrieval")
    made = make_bundle(project / "models", tmp_path / "small", generator="text2token", without=["evaluator"])
    assert "evaluator" not in made["systems"]
    small, whole = motionary.load(tmp_path / "small", "cpu"), motionary.load(project / "models", "cpu")
    training = set(corpus.clips.id[corpus.rows("train", captioned=True)])
    found = [match.id for match in whole.search(TEXTS[0], k=len(corpus)) if match.id in training]
    assert [match.id for match in small.search(TEXTS[0], k=3)] == found[:3]
    assert small.embed(texts=TEXTS).shape == (2, motions.shape[1])


def test_weights_take_half_the_bytes_and_answer_alike(bundle, packed, run, pipeline):
    for name in ("text2token", "joint_evaluator"):
        whole, half = (load_file(folder / name / "model.safetensors") for folder in (pipeline / "models", bundle))
        assert {value.dtype for value in half.values()} <= {np.dtype(np.float16), np.dtype(np.int64)}
        assert all(np.allclose(half[key], whole[key], rtol=1e-3, atol=1e-6) for key in whole)
    walk = demo_clip(3)[0]
    for judge in ("evaluator", "joint_evaluator"):
        for given in ({"texts": TEXTS}, {"motions": [walk]}):
            a, b = (d.embed(**given, system=judge) for d in (run, packed))
            assert np.abs(a - b).max() < 0.01 * np.abs(a).max()
    a, b = (d.generate(TEXTS[0], seconds=2, seed=3, system="text2token")[0] for d in (run, packed))
    assert a.frames == b.frames
    assert np.abs(a.positions - b.positions).max() < 0.05
    assert len(packed.caption(walk, n=2)) == 2


def test_nothing_is_unpickled(bundle):
    d = motionary.load(bundle, "cpu")
    sys.addaudithook(listen)
    listening.append(True)
    try:
        d.caption(d.generate(TEXTS[0], seconds=1)[0])
        d.search(TEXTS[0])
        FixedSample.load(bundle / "sample.npz")
    finally:
        listening.clear()
    assert not unpickled


def test_search_looks_over_the_texts_of_training_alone(packed, run):
    found, whole = packed.search(TEXTS[0], k=50), run.search(TEXTS[0], k=50)
    assert all(match.motion is None and match.captions for match in found)
    distances = {match.id: match.distance for match in whole}
    assert 0 < len(found) < len(whole)
    for match in found:
        assert match.distance == pytest.approx(distances[match.id], rel=0.01)
    with pytest.raises(InputError, match="no motion"):
        packed.generate(TEXTS[0], system="retrieval")


def test_what_a_bundle_lacks_is_asked_of_trained_models(packed):
    with pytest.raises(InputError, match=r"stylization: not part of this bundle; .*--models or \$MOTIONARY_MODELS$"):
        packed.stylize(packed.generate("a person walks", seconds=2)[0], style="old")


def test_the_card_says_what_the_weights_score(bundle, packed):
    manifest, card = json.loads((bundle / "bundle.json").read_text()), (bundle / "CARD.md").read_text()
    again = FixedSample.load(bundle / "sample.npz").scores(packed)
    assert again == manifest["sample"]
    for judge, rows in again.items():
        for kind, words in (("real", "real motions"), ("captions", "captions of the motions")):
            assert f"| {judge} | {words} | " + " | ".join(f"{value:.3f}" for value in rows[kind]) in card
    for heading in ("## Data", "## Known failures", "## Not to be used for"):
        assert heading in card


def test_the_packaged_models_score_what_their_card_says_and_answer():
    manifest, shipped = (
        json.loads((places.PACKAGED / "bundle.json").read_text()),
        motionary.load(places.PACKAGED, "cpu"),
    )
    assert sum(file.stat().st_size for file in places.PACKAGED.rglob("*") if file.is_file()) <= making.MOST_BYTES
    sample = FixedSample.load(places.PACKAGED / "sample.npz").scores(shipped)
    for judge, rows in manifest["sample"].items():  # another processor may rank a pair of 32 differently
        for kind in ("real", "captions", "generated"):
            assert np.abs(np.subtract(sample[judge][kind], rows[kind])).max() <= 3 / 32
    sys.addaudithook(listen)
    listening.append(True)
    try:
        walk = shipped.generate("a person walks forward", seconds=4, seed=0)[0]
        assert np.ptp(walk.positions[:, 0], axis=0)[[0, 2]].max() > 0.5
        assert shipped.caption(walk)[0]
        assert "jump" in " ".join(
            caption for match in shipped.search("a person jumps", k=5) for caption in match.captions
        )
    finally:
        listening.clear()
    assert not unpickled


def test_the_packaged_models_do_what_they_are_told():
    """In the oracle's eyes; the card names what they fail at."""
    texts = [
        f"a person {what}" for what in ("walks forward", "jumps up", "walks backwards", "waves with the right hand")
    ]
    rows = asked(motionary.load(places.PACKAGED, "cpu"), texts, seeds=4).rows
    assert all(int(done.split()[0]) >= 3 for _, done in rows), rows


@pytest.mark.real
def test_the_packaged_judge_knows_a_take_again_on_another_rig(shared_data):
    """Four takes of CMU on another company's character, among all takes of CMU in `captioned`."""
    shipped = motionary.load(places.PACKAGED, "cpu")
    takes = [str(file) for file in sorted((shared_data / "captioned/motions").glob("[0-9]*.npy"))]
    rigs = [str(file) for file in sorted((shared_data / "bvh/motions").glob("cc_02_0*.bvh"))]
    rows = recognized(shipped, rigs, takes, fps=20).rows
    assert len(rows) == 4
    assert all(int(rank.split()[0]) <= 5 for _, rank, _ in rows), rows


def test_a_bundle_replaces_nothing_unless_told(bundle, pipeline, tmp_path, capsys, monkeypatch):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/precious.txt").write_text("precious")
    with pytest.raises(InputError, match="is no bundle"):
        make_bundle(pipeline / "models", tmp_path / "mine", force=True)
    code, _, err = call(capsys, "bundle", str(pipeline / "models"), "--out", str(bundle))
    assert (code, "--force" in err) == (2, True)
    with pytest.raises(InputError, match=r"generator: tokenizer: must be one of .*text2token"):
        make_bundle(pipeline / "models", tmp_path / "new", generator="tokenizer")
    monkeypatch.setattr(making, "MOST_BYTES", 1000)
    with pytest.raises(InputError, match=r"MB: must have at most 0\.001"):
        make_bundle(pipeline / "models", tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_models_that_are_not_named_are_found_and_said_once(bundle, pipeline, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(places, "_TOLD", set())
    monkeypatch.setattr(places, "PACKAGED", tmp_path / "nowhere")
    with pytest.raises(InputError, match="none packaged"):
        motionary.load()
    monkeypatch.setattr(places, "PACKAGED", bundle)
    (tmp_path / "models").mkdir()  # somebody's own, of something else
    assert motionary.load().models == motionary.load().models == bundle
    assert capsys.readouterr().err == f"models: {bundle} (packaged)\n"
    shutil.copytree(pipeline / "models" / "tokenizer", tmp_path / "models/tokenizer")
    assert motionary.load().models == Path("models")
    monkeypatch.setenv("MOTIONARY_MODELS", str(pipeline / "models"))
    assert motionary.load().models == pipeline / "models"
    monkeypatch.setenv("MOTIONARY_MODELS", "missing")
    with pytest.raises(InputError, match="MOTIONARY_MODELS: missing"):
        motionary.load()


def test_an_installed_package_brings_the_bundle(bundle, repository, tmp_path):
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(repository / name, tmp_path)
    shutil.copytree(repository / "src", tmp_path / "src", ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    shutil.rmtree(tmp_path / "src/motionary/pretrained/bundle", ignore_errors=True)
    shutil.copytree(bundle, tmp_path / "src/motionary/pretrained/bundle")
    line = "from setuptools.build_meta import build_wheel; print(build_wheel('dist'))"
    made = subprocess.run([sys.executable, "-c", line], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert made.returncode == 0, made.stderr
    (wheel,) = (tmp_path / "dist").glob("*.whl")
    inside = {name.removeprefix("motionary/pretrained/bundle/") for name in zipfile.ZipFile(wheel).namelist()}
    assert {file.relative_to(bundle).as_posix() for file in bundle.rglob("*") if file.is_file()} <= inside
