"""A folder that lists its files is named by its list; whatever does not fit to the list is an error."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from motionary.corpus.writing import list_files
from motionary.errors import InputError
from motionary.pipeline.workspace import content_hash


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
