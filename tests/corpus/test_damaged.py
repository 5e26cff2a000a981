"""What a disk has damaged of a corpus is one line that names the file and the stage to run."""

import json
import shutil

import numpy as np
import pyarrow.parquet as pq
import pytest

from motionary.corpus.store import Corpus
from motionary.corpus.token_store import TokenStore
from motionary.errors import InputError
from motionary.systems.judges.corpus_search import Index


def first_bytes(share):
    return lambda path: path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])


def turned(place):
    """Turns a bit."""

    def damage(path):
        data = bytearray(path.read_bytes())
        data[int(place * len(data))] ^= 8
        path.write_bytes(data)

    return damage


def fewer_frames(path):
    np.save(path, np.load(path)[:-1])


def narrower(path):
    np.save(path, np.load(path)[:, :-1])


def fewer_rows(path):
    pq.write_table(pq.read_table(path).slice(0, 3), path)


def without(key):
    def damage(path):
        values = json.loads(path.read_text())
        path.write_text(json.dumps({name: value for name, value in values.items() if name != key}))

    return damage


DAMAGES = [
    ("frames.npy", first_bytes(0.9), "frames.npy"),
    ("frames.npy", first_bytes(0), "frames.npy"),
    ("frames.npy", turned(0), "frames.npy"),
    ("frames.npy", fewer_frames, "clips.parquet"),  # as it says where windows lie
    ("frames.npy", narrower, "frames.npy"),
    ("clips.parquet", first_bytes(0.5), "clips.parquet"),
    ("clips.parquet", first_bytes(0), "clips.parquet"),
    ("clips.parquet", turned(0.3), "clips.parquet"),
    ("clips.parquet", fewer_rows, "captions.parquet"),
    ("captions.parquet", turned(0.3), "captions.parquet"),
    ("captions.parquet", lambda path: path.unlink(), "captions.parquet"),
    ("context.json", first_bytes(0.5), "context.json"),
    ("context.json", without("mean"), "context.json"),
    ("context.json", lambda path: path.write_text("[]"), "context.json"),
]


@pytest.mark.parametrize(("name", "damage", "told"), DAMAGES)
def test_a_damaged_corpus_is_named(corpus, tmp_path, name, damage, told):
    folder = tmp_path / "corpus"
    shutil.copytree(corpus.folder, folder)
    damage(folder / name)
    with pytest.raises(InputError) as caught:
        Corpus.open(folder)
    assert caught.value.what == str(folder / told)
    assert caught.value.rule == "missing or damaged; run `dvc repro preprocess`"
    assert "\n" not in str(caught.value)


def test_a_corpus_s_report_too(corpus, tmp_path):
    shutil.copytree(corpus.folder, tmp_path / "corpus")
    (tmp_path / "corpus/report.json").write_text("{")
    with pytest.raises(InputError, match=r"report.json: .*run `dvc repro preprocess`"):
        _ = Corpus.open(tmp_path / "corpus").hash


@pytest.mark.parametrize("damage", [first_bytes(0.5), first_bytes(0), turned(0), lambda path: path.unlink()])
@pytest.mark.parametrize("name", ["tokens.npy", "offsets.npy"])
def test_damaged_tokens_are_named(tmp_path, name, damage):
    store = TokenStore.collect([np.arange(5), np.arange(3)])
    folder = tmp_path / "residual_tokenizer"
    store.save(folder)
    assert [list(TokenStore.load(folder)[i]) for i in (0, 1)] == [list(store[i]) for i in (0, 1)]
    damage(folder / name)
    with pytest.raises(InputError, match=rf"{name}: .*damaged; run `dvc repro residual_tokenizer`"):
        TokenStore.load(folder)


def test_tokens_of_another_run_are_named(tmp_path):
    TokenStore.collect([np.arange(5), np.arange(3)]).save(tmp_path)
    np.save(tmp_path / "tokens.npy", np.arange(7))
    with pytest.raises(InputError, match=r"offsets.npy: offsets: 0..8: must rise from 0 to 7 tokens: "):
        TokenStore.load(tmp_path)


@pytest.mark.parametrize("name", ["motions.npy", "index.json"])
def test_a_damaged_index_is_named(tmp_path, name):
    Index(np.zeros((4, 2), np.float32), "judge").save(tmp_path)
    assert Index.load(tmp_path).evaluator == "judge"
    first_bytes(0.5)(tmp_path / name)
    with pytest.raises(InputError, match=rf"{name}: .*damaged; run `dvc repro retrieval`"):
        Index.load(tmp_path)
