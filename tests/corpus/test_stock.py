"""Taking stock of a root again reads only what changed, and says the same."""

from __future__ import annotations

import os

import pytest

from motionary.corpus import files_of_root
from motionary.corpus.sources import inventory


def test_stock_reads_only_what_changed(tmp_path, folder_of, monkeypatch):
    """A file as it was is not opened again, and one that changed is, though its size and its own time stayed."""
    lines = [{"motion": f"motions/{name}.npy", "fps": 20} for name in ("one", "two")]
    root, stock = folder_of(tmp_path / "x", lines), tmp_path / "cache" / "stock.json"
    monkeypatch.setattr(files_of_root, "_COARSE", 0)
    first = inventory(root, False, stock)
    read = []
    monkeypatch.setattr(files_of_root.hashlib, "file_digest", _counting(read))
    assert inventory(root, False, stock) == first
    assert read == []
    path = root / "motions/two.npy"
    state, data = path.stat(), bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(bytes(data))
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))
    second = inventory(root, False, stock)
    assert read == ["two.npy"]
    assert [a == b for a, b in zip(first["files"], second["files"], strict=True)] == [True, True, False]
    lines[0]["fps"] = 40  # what a listing says of a file counts, too
    folder_text = "".join(f'{{"motion": "{line["motion"]}", "fps": {line["fps"]}}}\n' for line in lines)
    (root / "clips.jsonl").write_text(folder_text)
    third = inventory(root, False, stock)
    assert third["files"][1]["seconds"] == first["files"][1]["seconds"] / 2


@pytest.mark.parametrize("text", ["", "[1]", '{"clips.jsonl": 3, "motions/one.npy": [1, 2]}', "[" * 100_000])
def test_a_damaged_stock_counts_as_none(tmp_path, folder_of, text):
    root = folder_of(tmp_path / "x", [{"motion": "motions/one.npy", "fps": 20}])
    (tmp_path / "stock.json").write_text(text)
    assert inventory(root, False, tmp_path / "stock.json") == inventory(root, False)


def test_files_that_changed_a_moment_ago_are_read_again(tmp_path, folder_of):
    root = folder_of(tmp_path / "x", [{"motion": "motions/one.npy", "fps": 20}])
    inventory(root, False, tmp_path / "stock.json")
    assert not (tmp_path / "stock.json").exists()


def _counting(read):
    """file_digest that remembers which files it read."""
    digest = files_of_root.hashlib.file_digest

    def counted(file, name):
        read.append(os.path.basename(file.name))
        return digest(file, name)

    return counted
