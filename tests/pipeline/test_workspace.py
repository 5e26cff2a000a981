"""A folder that lists its files is named by its list; whatever does not fit to the list is an error, to the bit."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path

import numpy as np
import pytest

from motionary import whole
from motionary.corpus.token_store import TokenStore
from motionary.errors import InputError
from motionary.files import file_hash, list_files
from motionary.pipeline.workspace import Workspace, content_hash
from motionary.whole import check_whole


@pytest.fixture
def corpus(tmp_path) -> Path:
    folder = tmp_path / "corpus"
    folder.mkdir()
    (folder / "frames.npy").write_bytes(b"12345")
    (folder / "context.json").write_text("{}")
    return folder


def test_the_list_tells_sizes_and_hashes(corpus):
    list_files(corpus)
    told = json.loads((corpus / "files.json").read_text())
    assert told["frames.npy"] == {"bytes": 5, "sha256": hashlib.sha256(b"12345").hexdigest()}
    assert set(told) == {"frames.npy", "context.json"}


def test_content_counts_with_a_list_and_without(corpus):
    bare = content_hash(corpus)
    (corpus / "frames.npy").write_bytes(b"12346")
    assert content_hash(corpus) != bare
    list_files(corpus)
    listed = content_hash(corpus)
    (corpus / "frames.npy").write_bytes(b"12345")
    list_files(corpus)
    assert content_hash(corpus) != listed


def test_a_listed_folder_is_not_read(corpus):
    list_files(corpus)
    named = content_hash(corpus)
    (corpus / "frames.npy").write_bytes(b"54321")  # only who reads it could tell
    assert content_hash(corpus) == named


@pytest.mark.parametrize("change", ["shorter", "absent", "new"])
def test_a_folder_that_is_not_its_list_is_an_error(corpus, change):
    list_files(corpus)
    if change == "shorter":
        (corpus / "frames.npy").write_bytes(b"1234")
    elif change == "absent":
        (corpus / "frames.npy").unlink()
    else:
        (corpus / "frames_2.npy").write_bytes(b"1")
    with pytest.raises(InputError, match=r"frames.*npy.*dvc repro preprocess"):
        content_hash(corpus)


def test_a_list_that_cannot_be_read_is_an_error(corpus):
    (corpus / "files.json").write_text("[]")
    with pytest.raises(InputError, match="preprocess"):
        content_hash(corpus)


def flip(file: Path, place: int) -> None:
    """One bit of a file turned, as a disk does it."""
    data = bytearray(file.read_bytes())
    data[place] ^= 1
    file.write_bytes(data)


def test_a_flipped_bit_of_a_corpus_names_the_file_and_the_stage(tmp_path):
    folder = tmp_path / "data/corpus"
    folder.mkdir(parents=True)
    np.save(folder / "frames.npy", np.random.default_rng(0).normal(size=(40, 263)).astype(np.float32))
    (folder / "context.json").write_text("{}")
    list_files(folder)
    here = Workspace(tmp_path, tmp_path, tmp_path)
    assert here.input("data/corpus") == folder
    for file in (folder / "context.json", folder / "frames.npy"):
        whole = file.read_bytes()
        flip(file, len(whole) // 2)
        with pytest.raises(InputError, match=r"damaged, its SHA-256 differs.*; run `dvc repro preprocess`") as told:
            here.input("data/corpus")
        assert str(told.value).startswith(str(file))
        assert "\n" not in str(told.value)
        file.write_bytes(whole)
        here.input("data/corpus")  # mended, it counts as whole again


def test_a_flipped_bit_of_what_a_stage_published_names_that_stage(tmp_path):
    here = Workspace(tmp_path, tmp_path, tmp_path)
    with here.publish("models/tokenizer") as folder:
        TokenStore(np.arange(90) % 8, np.array([0, 40, 90])).save(folder)
        (folder / "deep").mkdir()
        (folder / "deep/config.json").write_text("{}")
    folder = here.input("models/tokenizer")
    flip(folder / "tokens.npy", 200)
    with pytest.raises(InputError, match=r"tokens\.npy: damaged.*run `dvc repro tokenizer`"):
        here.input("models/tokenizer")
    flip(folder / "tokens.npy", 200)
    flip(folder / "deep/config.json", 0)
    with pytest.raises(InputError, match=r"deep/config\.json: damaged.*run `dvc repro tokenizer`"):
        here.input("models/tokenizer")


def test_what_was_found_whole_is_read_once_until_it_changes(corpus, tmp_path, monkeypatch):
    list_files(corpus)
    mark, read = tmp_path / "marks/corpus.json", []

    def reading(path):
        read.append(path.name)
        return file_hash(path)

    monkeypatch.setattr(whole, "file_hash", reading)
    check_whole(corpus, mark)
    assert sorted(read) == ["context.json", "frames.npy"]
    check_whole(corpus, mark)
    assert len(read) == 2
    os.utime(corpus / "frames.npy", (1, 1))  # as a checkout does
    check_whole(corpus, mark)
    assert read[2:] == ["frames.npy"]
    mark.write_text(mark.read_text()[:20])  # a process was killed here
    check_whole(corpus, mark)
    assert len(read) == 5
    flip(corpus / "frames.npy", 3)
    for _ in range(2):
        with pytest.raises(InputError, match=r"frames\.npy: damaged"):
            check_whole(corpus, mark)
