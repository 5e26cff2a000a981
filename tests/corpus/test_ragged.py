"""Rows kept on disk are made once, and once more where the disk has damaged them."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.corpus.ragged import Ragged

ROWS = [np.arange(6, dtype=np.float32).reshape(3, 2), np.ones((2, 2), np.float32)]


@pytest.fixture
def made(tmp_path):
    """A function that opens the rows of one folder, and how often they were made."""
    calls = []

    def rows():
        calls.append(1)
        return ROWS

    return lambda: Ragged.cached(tmp_path / "kept", rows), calls, tmp_path / "kept"


def test_rows_are_made_once(made, capsys):
    open_it, calls, _ = made
    for _ in range(2):
        found = open_it()
        assert [row.tolist() for row in (found[0], found[1])] == [row.tolist() for row in ROWS]
    assert len(calls) == 1
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("name", ["values.bin", "offsets.npy", "shape.json", "files.json"])
def test_a_flipped_bit_is_said_and_the_rows_made_anew(made, capsys, name):
    open_it, calls, folder = made
    open_it()
    data = bytearray((folder / name).read_bytes())
    data[len(data) // 2] ^= 1
    (folder / name).write_bytes(data)
    found = open_it()
    assert [row.tolist() for row in (found[0], found[1])] == [row.tolist() for row in ROWS]
    assert len(calls) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"warning: {folder}/")
    assert name == "files.json" or f"/{name}: damaged" in said
    assert said.count("\n") == 1
