"""What TEMOS is trained on: features of the corpus's windows, captions' states, caches, what is left out."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import torch

import motionary
from motionary.corpus.batches import Batches
from motionary.corpus.demo import demo_clip
from motionary.corpus.ragged import Ragged
from motionary.corpus.refeatured import from_corpus, own_features
from motionary.corpus.store import Corpus
from motionary.errors import InputError
from motionary.features import codec
from motionary.language import Sentence, annotate
from motionary.language.frozen import state_dim, token_ids, token_states
from motionary.nn.layers import seeded
from motionary.systems.io import Trained, build_model, open_system, save_model
from motionary.systems.registry import BLEND, EMBED, SEARCH, TEXT_TO_MOTION, offering
from motionary.systems.temos.joint_space import JointSpace, LatentIndex
from motionary.systems.temos.training_data import training_data

SETTINGS = {"latent": 16, "num_layers": 1, "num_heads": 2, "dim_feedforward": 16, "most_captions": 1}


@pytest.fixture(scope="module")
def corpus(pipeline) -> Corpus:
    return Corpus.open(pipeline / "data/corpus")


@pytest.fixture(scope="module")
def trained(pipeline, corpus, tmp_path_factory):
    """An untrained model, its data, the folder that holds it and text2length beside a corpus."""
    root = tmp_path_factory.mktemp("temos")
    (root / "data").symlink_to(pipeline / "data")
    models = root / "models"
    models.mkdir()
    for name in ("text2length", "evaluator", "retrieval"):
        (models / name).symlink_to(pipeline / "models" / name)
    with seeded(0):
        model = build_model("temos", SETTINGS, corpus.context, Trained(models))
    data = training_data(model, corpus, root / "motion", root / "texts")
    save_model(models / "temos", "temos", model.eval(), corpus.context)
    LatentIndex(JointSpace(model, "").own(data.features)).save(models / "temos")
    return model, data, root


def test_rows_of_different_lengths_return_from_disk(tmp_path):
    rng = np.random.default_rng(0)
    rows = [rng.normal(size=(n, 3)).astype(np.float32) for n in (4, 1, 6)]
    made = []

    def make():
        made.append(True)
        return rows

    for _ in range(2):
        stored = Ragged.cached(tmp_path / "rows", make)
        assert all(np.array_equal(stored[i], row) for i, row in enumerate(rows))
    assert len(made) == 1  # the second reads what the first wrote
    values, count = stored.padded(np.array([2, 1]))
    assert count.tolist() == [6, 1]
    assert np.array_equal(values[0], rows[2])
    assert not values[1, 1:].any()


@pytest.mark.parametrize(("form", "fps"), [("rifke", 20.0), ("rifke", 12.5), ("rotation", 12.5)])
def test_windows_return_from_their_own_features(corpus, form, fps):
    made = codec(form, corpus.context.skeleton)
    real = corpus.motion(0)
    features = from_corpus(corpus.features(0), corpus.context, made, fps)
    assert len(features) == int((real.frames - 1) * fps / 20 + 1e-3) + 1
    back = made.decode(features, fps=fps)
    if fps == 20.0:
        np.testing.assert_allclose(back.positions, real.positions, atol=1e-4)
    np.testing.assert_allclose(own_features(back, made, fps)[:-1], features[:-1], atol=1e-4)


def test_batches_hold_the_frozen_models_states_of_the_drawn_caption(trained, corpus):
    model, data, _ = trained
    batch = next(iter(Batches(data.train, 4).epoch(0)))
    rows, captions = batch.clip.numpy(), batch.caption.numpy()
    texts = [str(corpus.captions.text[caption]) for caption in captions]
    for row, states in enumerate(token_states(texts)):
        assert batch.state_count[row] == len(states)
        np.testing.assert_allclose(batch.states[row, : len(states)], states, atol=2e-3)
    features = from_corpus(corpus.features(rows[0]), corpus.context, model.codec, model.config.fps)
    np.testing.assert_allclose(batch.motion[0, : len(features)], features, atol=1e-6)
    assert batch.frames[0] == len(features)
    assert captions.tolist() == [corpus.caption_start[row] for row in rows]  # most_captions=1: the first


def test_training_draws_captions_and_validation_takes_the_first(corpus, trained, tmp_path):
    _, _, root = trained
    with seeded(0):
        model = build_model("temos", {**SETTINGS, "most_captions": 0}, corpus.context, Trained(root / "models"))
    data = training_data(model, corpus, root / "motion", tmp_path / "texts")
    clip = int(np.argmax(np.diff(corpus.caption_start) * np.isin(np.arange(len(corpus)), data.train.pairs.rows)))
    place = np.flatnonzero(data.train.pairs.rows == clip)
    drawn = {int(data.train.collate(place, np.random.default_rng(seed)).caption[0]) for seed in range(40)}
    assert drawn == set(corpus.captions_of(clip))
    assert len(drawn) > 1
    held = data.validation.collate(np.arange(len(data.validation)), np.random.default_rng(0))
    assert held.caption.tolist() == corpus.caption_start[held.clip.numpy()].tolist()


def test_features_are_standardized_over_the_training_split(trained):
    model, data, _ = trained
    frames = np.concatenate([data.features[row] for row in data.train.pairs.rows])
    normal = model.normalizer(torch.from_numpy(frames)).numpy()
    np.testing.assert_allclose(normal.mean(0), 0, atol=1e-2)
    moving = frames.std(0) > 1e-3
    np.testing.assert_allclose(normal.std(0)[moving], 1, atol=1e-2)


def test_long_windows_are_left_out_and_none_left_is_an_error(trained, corpus):
    _, data, root = trained
    shortest, longest = int(data.train.lengths.min()), int(data.train.lengths.max())
    assert shortest < longest
    for most, kept in ((longest - 1, True), (shortest - 1, False)):
        with seeded(0):
            small = build_model("temos", {**SETTINGS, "max_frames": most}, corpus.context, Trained(root / "models"))
        if kept:
            again = training_data(small, corpus, root / "motion", root / "texts")
            assert 0 < len(again.train) < len(data.train)
            assert again.train.lengths.max() <= most
        else:
            with pytest.raises(InputError, match="max_frames"):
                training_data(small, corpus, root / "motion", root / "texts")


def test_the_registry_opens_all_that_it_offers(trained, corpus):
    _, _, root = trained
    models = root / "models"
    sentences = annotate(["a person waves", "a person walks forward"])
    motions = open_system("temos", TEXT_TO_MOTION, models).generate(sentences, [0, 1])
    assert all(m.frames % 4 == 0 and m.skeleton.joints == corpus.context.skeleton.joints for m in motions)
    assert len(open_system("temos", BLEND, models).blend(*sentences, steps=3, frames=24)) == 3
    space = open_system("temos", EMBED, models)
    rows = np.arange(5)
    embedded = space.motions([corpus.features(row) for row in rows])
    search = open_system("temos", SEARCH, models)
    np.testing.assert_allclose(search.index.motions[rows], embedded, atol=1e-4)
    found = search.search(sentences, 3)
    away = np.linalg.norm(space.sentences(sentences)[:, None] - search.index.motions[None], axis=-1)
    unmirrored = np.flatnonzero(~corpus.clips.mirrored)
    assert found[0, 0] == unmirrored[away[0, unmirrored].argmin()]
    assert (found.shape, offering(EMBED)[0], offering(SEARCH)[0]) == ((2, 3), "evaluator", "retrieval")


def test_the_dictionary_asks_it_like_any_other(trained, corpus):
    _, _, root = trained
    d = motionary.load(root / "models", "cpu")
    first, second = d.generate("a person waves", n=2, seconds=2, system="temos", seed=3)
    assert first.frames == second.frames == 40
    assert np.abs(first.positions - second.positions).max() > 1e-4  # variants by seed
    line = d.blend("a person waves", "a person walks", steps=4, seconds=2, seed=3)
    np.testing.assert_allclose(line[0].positions[:, 0], line[1].positions[:, 0], atol=2)
    assert [motion.frames for motion in line] == [40] * 4
    texts, motions = d.embed("a person waves", system="temos"), d.embed(motions=corpus.motion(0), system="temos")
    assert texts.shape == motions.shape == (1, 16)
    found = d.search("a person waves", k=3, system="temos")
    assert [match.distance for match in found] == sorted(match.distance for match in found)
    for call, rule in (
        (lambda: d.generate("walk", seconds=0, system="temos"), "seconds: 0: must be a number from"),
        (lambda: d.generate("walk " * 2000, system="temos"), "must have at most 1000 characters, has 9999"),
        (lambda: d.blend("walk", "run", steps=1), "steps: 1"),
        (lambda: d.blend("walk", ""), "second: ''"),
        (lambda: d.blend("walk", "run", system="text2length"), "does not go from one text to another"),
    ):
        with pytest.raises(InputError, match=rule):
            call()


def test_the_shell_makes_motions_by_it(trained, tmp_path):
    _, _, root = trained
    command = [sys.executable, "-m", "motionary.cli", "generate", "a person waves", "--system", "temos"]
    command += ["--models", str(root / "models"), "--seconds", "2", "--out", str(tmp_path), "--format", "bvh"]
    done = subprocess.run([*command, "--device", "cpu"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (file,) = tmp_path.glob("*.bvh")
    assert motionary.read_motion(file).frames == 40


def test_a_corpus_without_captions_is_one_line(tmp_path):
    from motionary.corpus.preprocess import preprocess

    motions = tmp_path / "bare"
    motions.mkdir()
    for number in range(4):
        np.save(motions / f"{number}.npy", demo_clip(number)[0].positions)
    settings = {"source": "folder", "roots": [str(motions)], "workers": 1, "ratios": [0.5, 0.25, 0.25]}
    preprocess(settings, tmp_path / "corpus", progress=False)
    corpus = Corpus.open(tmp_path / "corpus")
    with seeded(0):
        model = build_model("temos", SETTINGS, corpus.context, Trained(tmp_path))
    with pytest.raises(InputError, match="no caption: this learns from captions"):
        training_data(model, corpus, tmp_path / "motion", tmp_path / "texts")


def test_the_rotation_form_generates_rotations(corpus, trained, tmp_path):
    _, _, root = trained
    with seeded(0):
        model = build_model("temos", {**SETTINGS, "features": "rotation"}, corpus.context, Trained(root / "models"))
    training_data(model, corpus, tmp_path / "motion", root / "texts")
    from motionary.systems.temos.temos_generator import TemosGenerator

    (motion,) = TemosGenerator(model, lambda *_: []).generate(annotate(["a person walks"]), [0], [40])
    assert motion.rotations is not None
    motion.save(tmp_path / "skinned.glb")  # the skinned character of formats
    from pygltflib import GLTF2

    scene = GLTF2().load(str(tmp_path / "skinned.glb"))
    assert scene.skins
    assert len(scene.animations[0].channels) >= 22


def test_states_do_not_depend_on_the_other_texts():
    texts = ["a person walks", "somebody throws a ball with the left hand and then sits down on a chair", "run"]
    together = list(token_states(texts))
    assert [len(s) for s in together] == [len(ids) for ids in token_ids(texts)]
    assert {s.shape[1] for s in together} == {state_dim()}
    for text, states in zip(texts, together, strict=True):
        np.testing.assert_allclose(next(iter(token_states([text]))), states, atol=2e-3)


def test_a_language_model_that_is_not_there_is_one_line(corpus, tmp_path):
    with pytest.raises(InputError, match=r"language model: .*nowhere: must be the folder or name of a locally stored"):
        build_model("temos", {"language_model": str(tmp_path / "nowhere")}, corpus.context, Trained(tmp_path))


def test_typos_are_corrected_before_the_language_model_reads(context):
    typo = Sentence("A persn walks slowly.", ("a", "persn", "walk", "slowly"), ("DET", "NOUN", "VERB", "ADV"))
    assert context.vocabulary.mended(typo) == "A person walks slowly."
    plain = Sentence("A person walks!", ("a", "person", "walk"), ("DET", "NOUN", "VERB"))
    assert context.vocabulary.mended(plain) == "A person walks!"
    assert context.vocabulary.mended(Sentence("", ("a", "person"), ("DET", "NOUN"))) == "a person"
