"""The dictionary on untrained systems: what is asked is what comes, whatever is asked beside it."""

from __future__ import annotations

import shutil
import subprocess
import sys

import numpy as np
import pytest
from strides import on_the_floor

import motionary
from motionary.corpus.demo import demo_clip
from motionary.dictionary.dictionary import encode
from motionary.errors import InputError
from motionary.files import list_files
from motionary.motion import Motion
from motionary.systems.registry import TEXT_TO_MOTION

TEXTS = ["a person walks forward", "somebody waves with the left hand three times", "jump"]


@pytest.fixture(scope="module")
def d(pipeline):
    return motionary.load(pipeline / "models", device="cpu")


@pytest.fixture(scope="module")
def walk() -> Motion:
    return demo_clip(3)[0]


def same(a: Motion, b: Motion) -> bool:
    return a.frames == b.frames and np.allclose(a.positions, b.positions, atol=1e-4)


def test_it_knows_what_lies_there(d):
    assert d.systems == (
        "evaluator", "inverse_alignment", "joint_evaluator", "motion2text", "retrieval", "text2length", "text2motion",
        "text2token", "tokenizer",
    )  # fmt: skip


def test_generate_gives_as_many_as_asked(d):
    one = d.generate("a person walks")
    assert len(one) == 1
    assert isinstance(one[0], Motion)
    assert one[0].fps == 20
    assert one[0].skeleton.name == "smpl22"
    many = d.generate(TEXTS, n=2)
    assert [len(row) for row in many] == [2, 2, 2]
    assert all(motion.frames % 4 == 0 for row in many for motion in row)


def test_a_seed_repeats_and_company_changes_nothing(d):
    together = d.generate(TEXTS, n=3, seed=5)
    for text, row in zip(TEXTS, together, strict=True):
        alone = d.generate(text, n=2, seed=5)
        assert all(same(a, b) for a, b in zip(alone, row, strict=False))
    assert not same(together[0][0], together[0][1])
    assert not same(together[0][0], d.generate(TEXTS[0], seed=6)[0])


def test_feet_stand_unless_they_shall_not(d):
    for name in d.offering(TEXT_TO_MOTION):
        raw, planted = (d.generate(TEXTS[0], system=name, seconds=2, feet=feet)[0] for feet in (False, True))
        stands = raw.plant_feet()
        near = stands.positions[..., 1].min() <= 0.1
        assert np.allclose(planted.positions, on_the_floor(stands) if near else stands.positions, atol=1e-4)
        assert not same(planted, raw)
    with pytest.raises(InputError, match="feet: yes: must be True or False"):
        d.generate(TEXTS[0], seconds=2, feet="yes")


@pytest.mark.parametrize(("seconds", "frames"), [(3, 60), (0.2, 4), (2.51, 52), (10, 196), (9.8, 196)])
def test_seconds_are_kept(d, seconds, frames):
    assert d.generate("a person walks", seconds=seconds)[0].frames == frames


def test_options_reach_the_sampler(d):
    cold = [d.generate(TEXTS[0], seed=s, seconds=2, greedy=True)[0] for s in (1, 2)]
    assert same(*cold)
    assert not same(*[d.generate(TEXTS[0], seed=s, seconds=2)[0] for s in (1, 2)])


def test_every_generator_can_be_asked(d):
    for system in ("text2token", "text2motion", "retrieval"):
        assert len(d.generate(TEXTS, system=system)) == 3
    with pytest.raises(InputError, match="does not turn text into motion"):
        d.generate("walk", system="tokenizer")
    have = "text2motion, text2token, inverse_alignment, retrieval"
    with pytest.raises(InputError, match=f"^system: poetry: must be one of {have}$"):
        d.generate("walk", system="poetry")
    with pytest.raises(InputError, match="does not turn motion into text"):
        d.caption(d.generate("walk")[0], system="text2token")


def test_caption_gives_as_many_as_asked(d, walk):
    found = d.caption(walk, n=3, beams=2)
    assert len(found) == 3
    assert all(isinstance(text, str) for text in found)
    generated = d.generate("a person jumps", seconds=4)[0]
    both = d.caption([walk, generated])
    assert both == [d.caption(walk), d.caption(generated)]
    drawn = [d.caption(walk, n=4, temperature=2.0, seed=s) for s in (1, 1, 2)]
    assert drawn[0] == drawn[1] != drawn[2]


def test_captions_by_consensus_come_from_the_search_or_the_draws(d, walk):
    agreed = d.caption(walk, n=2, beams=2, consensus=6, seed=1)
    assert agreed == d.caption(walk, n=2, beams=2, consensus=6, seed=1)
    assert len(set(agreed)) == 2
    possible = {*d.caption(walk, n=2, beams=2), *d.caption(walk, n=6, temperature=1.0, seed=1)}
    assert set(agreed) <= possible
    assert d.caption(walk, consensus=0) == d.caption(walk)
    for wrong in ({"consensus": -1}, {"consensus": 3, "temperature": 1.0}):
        with pytest.raises(InputError, match="consensus"):
            d.caption(walk, **wrong)


def test_any_rate_gives_the_same_features(d, walk):
    context = d.context("motion2text")
    fine = demo_clip(3, fps=60.0)[0]
    a, b = encode(walk, context), encode(fine, context)
    assert a.shape == b.shape
    assert np.abs(a[:-4, :67] - b[:-4, :67]).max() < 0.02
    moved = Motion(walk.positions + np.float32([3, 1, -2]), walk.fps, walk.skeleton)
    np.testing.assert_allclose(encode(moved, context)[:, :67], a[:, :67], atol=1e-4)


def test_features_are_the_corpus_s_own(d, pipeline):
    """A clip handed in by a user becomes what preprocess made of it."""
    corpus = motionary.corpus.store.Corpus.open(pipeline / "data/corpus")
    row = int(np.flatnonzero([name.endswith("000003") for name in corpus.clips.id])[0])
    np.testing.assert_allclose(encode(demo_clip(3)[0], corpus.context), corpus.features(row), atol=1e-5)


def test_long_motions_are_read_from_their_start(d, walk):
    long = Motion(np.concatenate([walk.positions] * 4), walk.fps, walk.skeleton)
    assert len(encode(long, d.context("motion2text"))) == 196


def test_a_motion_too_short_is_named(d, walk):
    with pytest.raises(InputError, match=r"motion: 0\.150 s: must last at least 0\.2 s"):
        d.caption(walk.crop(0, 3))
    assert d.caption(walk.crop(0, 4))


def test_generated_motions_are_read_whole(d):
    motion = d.generate("a person jumps", seconds=2)[0]
    assert motion.frames == 40
    features = encode(motion, d.context("motion2text"))
    assert len(features) == 40
    again = d.context("motion2text").make_codec().decode(features)
    np.testing.assert_allclose(np.diff(again.positions[:, 0, 1]), np.diff(motion.positions[:, 0, 1]), atol=1e-4)


def test_search_finds_windows(d, pipeline):
    found = d.search("a person walks", k=4)
    assert [m.distance for m in found] == sorted(m.distance for m in found)
    assert all(isinstance(m.motion, Motion) and m.captions for m in found)
    text = d.embed(texts="a person walks")
    corpus = motionary.corpus.store.Corpus.open(pipeline / "data/corpus")
    row = int(np.flatnonzero(corpus.clips.id == found[0].id)[0])
    motion = d.embed(motions=corpus.motion(row))
    assert float(np.linalg.norm(text - motion)) == pytest.approx(found[0].distance, abs=0.5)
    assert [m.id for m in d.search(["a person walks", "jump"], k=4)[0]] == [m.id for m in found]
    assert len(d.search("walk", k=10_000)) == len(corpus)


def test_embeddings_have_a_row_each(d, walk):
    texts = d.embed(texts=TEXTS)
    assert texts.shape == (3, 12)
    assert texts.dtype == np.float32
    np.testing.assert_allclose(d.embed(texts=TEXTS[1])[0], texts[1], atol=1e-5)
    assert d.embed(motions=[walk, walk]).shape == (2, 12)
    for wrong in ({}, {"texts": "walk", "motions": walk}):
        with pytest.raises(InputError, match="one of the two"):
            d.embed(**wrong)


def test_an_unknown_word_is_read_as_the_nearest_and_said(d):
    found = d.reading("a person does a cartwheel")
    assert found.replaced.keys() == {"cartwheel"}
    assert d.read_as("a person does a cartwheel") == found.words
    assert "<unknown>" not in found.words
    assert found.distance > 0.1
    assert "cartwheel" in found.line
    assert d.reading("he walks forward").line == ""
    by_other_words = d.generate(found.words, seed=2)[0]
    assert same(d.generate("a person does a cartwheel", seed=2)[0], by_other_words)
    assert len(d.generate("xqzt blorf")) == 1


def test_typos_are_read_as_words_of_the_corpus(d):
    assert d.read_as("a persn walks forwrd") == d.read_as("A person walks forward.")
    np.testing.assert_allclose(d.embed(texts="a persn walks"), d.embed(texts="a person walks"), atol=1e-6)


@pytest.mark.parametrize(
    ("call", "rule"),
    [
        (lambda d: d.generate(""), "text: '': must not be empty"),
        (lambda d: d.generate("w" * 10_000), "at most 1000 characters"),
        (lambda d: d.generate("человек идёт"), "English"),
        (lambda d: d.generate(3), "must be one str or a list"),
        (lambda d: d.generate([]), "must be one str or a list"),
        (lambda d: d.generate("walk", n=0), "n: 0"),
        (lambda d: d.generate("walk", seed=-1), "seed: -1"),
        (lambda d: d.generate("walk", seconds=0.1), r"seconds: 0\.1: must be a number from 0\.2 to 10"),
        (lambda d: d.generate("walk", seconds=60), "seconds: 60"),
        (lambda d: d.generate("walk", seconds=float("nan")), "seconds: nan"),
        (lambda d: d.generate("walk", heat=2.0), "heat: 2.0: unknown option"),
        (lambda d: d.caption("walk.bvh"), "must be one Motion"),
        (lambda d: d.search("walk", k=0), "k: 0"),
        (lambda d: d.stylize(demo_clip(3)[0], style="old"), "run `dvc repro stylization`"),
        (lambda d: d.act("walk"), "run `dvc repro action2motion`"),
    ],
)
def test_bad_input_is_one_line(d, call, rule):
    with pytest.raises(InputError, match=rule) as error:
        call(d)
    assert "\n" not in str(error.value)


def test_missing_models_name_the_stage_to_run(pipeline, tmp_path, walk):
    with pytest.raises(InputError, match="run `dvc repro`"):
        motionary.load(tmp_path / "models")
    models = tmp_path / "models"
    models.mkdir()
    with pytest.raises(InputError, match="holds no trained model"):
        motionary.load(models)
    shutil.copytree(pipeline / "models/inverse_alignment", models / "inverse_alignment")
    part = motionary.load(models)
    with pytest.raises(InputError, match="run `dvc repro tokenizer`"):
        part.generate("walk")
    with pytest.raises(InputError, match="run `dvc repro motion2text`"):
        part.caption(walk)
    with pytest.raises(InputError, match="run `dvc repro retrieval`"):
        part.search("walk")
    with pytest.raises(InputError, match="run `dvc repro evaluator`"):
        part.embed(texts="walk")
    shutil.copytree(pipeline / "models/tokenizer", models / "tokenizer")
    assert part.generate("walk")
    (models / "tokenizer/model.safetensors").write_bytes(b"half")
    with pytest.raises(InputError, match=r"model\.safetensors"):
        motionary.load(models).generate("walk")


def test_what_is_no_system_is_left_alone(pipeline, tmp_path, walk):
    """A folder of a name that nobody declared, which sorts before all, changes no answer and is not recommended."""
    models = tmp_path / "models"
    (models / "a_foo").mkdir(parents=True)
    (models / "a_foo/config.json").write_text("{}")
    with pytest.raises(InputError, match="holds no trained model"):
        motionary.load(models)
    shutil.copytree(pipeline / "models/text2length", models / "text2length")
    bare = motionary.load(models, "cpu")
    assert bare.systems == ("text2length",)
    assert bare.read_as("a persn walks") == "a person walk"
    for call in (lambda: bare.generate("walk", system="a_foo"), lambda: bare.caption(walk, system="a_foo")):
        with pytest.raises(InputError, match=r"^system: a_foo: none of these models can turn"):
            call()
    with pytest.raises(InputError, match=r"run `dvc repro text2motion`$"):
        bare.generate("walk")
    with pytest.raises(InputError, match=r"run `dvc repro text2token`$"):
        bare.generate("walk", system="text2token")
    (models / "retrieval").mkdir()
    with pytest.raises(InputError, match=r"system: evaluator: .* run `dvc repro evaluator`$"):
        bare.context("retrieval")
    shutil.copytree(pipeline / "models/tokenizer", models / "tokenizer")
    shutil.copytree(pipeline / "models/text2token", models / "text2token")
    full = motionary.load(models, "cpu")
    assert full.offering(TEXT_TO_MOTION) == ("text2token", "retrieval")
    assert full.generate("walk")[0].frames


def test_a_search_without_its_corpus_says_so(pipeline, tmp_path):
    shutil.copytree(pipeline / "models", tmp_path / "models")
    with pytest.raises(InputError, match="preprocess"):
        motionary.load(tmp_path / "models").search("walk")


def test_no_training_code_is_loaded(pipeline):
    code = (
        "import sys, motionary\n"
        f"d = motionary.load({str(pipeline / 'models')!r}, 'cpu')\n"
        "d.caption(d.generate('a person walks')[0])\n"
        "heavy = ('motionary.training', 'motionary.evaluation', 'hydra', 'mlflow', 'dvc', 'lightning_fabric')\n"
        "print([name for name in heavy if name in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.stdout.strip() == "[]", run.stderr


@pytest.mark.parametrize("name", ["data/corpus/frames.npy", "data/corpus/context.json", "models/retrieval/motions.npy"])
def test_search_notices_a_flipped_bit(pipeline, tmp_path, name):
    """Of whatever a run left that search reads; what no reading would notice is told by the list of the files."""
    for part in ("data/corpus", "models/retrieval", "models/evaluator"):
        shutil.copytree(pipeline / part, tmp_path / part)
        list_files(tmp_path / part)
    assert motionary.load(tmp_path / "models", device="cpu").search("a person walks", k=1)
    data = bytearray((tmp_path / name).read_bytes())
    data[-40] ^= 1
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=rf"{name}: damaged.*run `dvc repro (preprocess|retrieval)`"):
        motionary.load(tmp_path / "models", device="cpu").search("a person walks")
