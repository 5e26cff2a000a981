"""An index that a disk or a program has damaged ends a search in one line, which names the file."""

from __future__ import annotations

import json
import shutil
import tracemalloc
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from motionary.archive import Archive, index_folder
from motionary.cli.commands import main
from motionary.corpus.demo import demo_clip
from motionary.errors import InputError

DEEP = "[" * 100_000


@pytest.fixture(scope="module")
def indexed(tmp_path_factory, pipeline) -> Path:
    """A folder of two motions and its index."""
    folder = tmp_path_factory.mktemp("stored") / "mocap"
    folder.mkdir()
    for i in (3, 5):
        demo_clip(i, 5)[0].save(folder / f"{i}.bvh")
    index_folder(folder, pipeline / "models", None, "cpu", 1, progress=False)
    return folder


def told(**values):
    def change(place: Path):
        kept = json.loads((place / "index.json").read_text()) | values
        kept = {key: value for key, value in kept.items() if value is not None}
        (place / "index.json").write_text(json.dumps(kept))

    return "index.json", change


def column(table: str, name: str, value, kind=None):
    """A column of which every row is one value, or, where it is None and no kind is given, none."""

    def change(place: Path):
        found = pq.read_table(place / f"{table}.parquet")
        at = found.schema.get_field_index(name)
        kept = found.drop_columns([name])
        if value is not None or kind is not None:
            kept = kept.add_column(at, name, pa.array([value] * len(found), kind))
        pq.write_table(kept, place / f"{table}.parquet")

    return f"{table}.parquet", change


def embeddings(array: np.ndarray):
    return "embeddings.npy", lambda place: np.save(place / "embeddings.npy", array)


def cut(name: str):
    return name, lambda place: (place / name).write_bytes((place / name).read_bytes()[:-10])


def text(name: str, value: str):
    return name, lambda place: (place / name).write_text(value)


DAMAGE = {
    "no judge": told(judge=None),
    "no hash": told(judge_hash=None),
    "a number for a judge": told(judge=5),
    "a list for a judge": told(judge=["evaluator"]),
    "a path for a judge": told(judge="../../x"),
    "a judge that judges nothing": told(judge="motion2text"),
    "a number for a folder": told(folder=5),
    "a folder that none can be": told(folder="a\0b"),
    "deep": text("index.json", DEEP),
    "a list": text("index.json", "[]"),
    "long": text("index.json", " " * (1 << 20) + "{}"),
    "one flag too many": column("clips", "flags", "[["),
    "flags that are a list": column("clips", "flags", "[]"),
    "flags without words": column("clips", "flags", '{"idle": 5}'),
    "deep flags": column("clips", "flags", DEEP),
    "no flags": column("clips", "flags", None),
    "no file": column("clips", "file", None, pa.string()),
    "a number for a file": column("clips", "file", 5),
    "a clip too high": column("windows", "clip", 99),
    "a clip too low": column("windows", "clip", -1),
    "no caption": column("windows", "caption", None),
    "no start": column("windows", "start", None, pa.float64()),
    "a start that is no number": column("windows", "start", float("nan")),
    "an end before the start": column("windows", "end", -1.0),
    "cut windows": cut("windows.parquet"),
    "cut clips": cut("clips.parquet"),
    "cut embeddings": cut("embeddings.npy"),
    "embeddings in a row": embeddings(np.zeros(12, np.float32)),
    "embeddings of words": embeddings(np.array([["a"], ["b"]])),
    "embeddings of objects": embeddings(np.array([[{}], [{}]])),
    "too narrow": embeddings(np.zeros((2, 3), np.float32)),
    "of no width": embeddings(np.zeros((2, 0), np.float32)),
}


@pytest.mark.parametrize("case", DAMAGE)
def test_a_damaged_index_is_one_line(case, indexed, pipeline, tmp_path, capsys):
    shutil.copytree(indexed, tmp_path / "copy")
    place = tmp_path / "copy" / ".motionary" / "index"
    name, damage = DAMAGE[case]
    if case == "too narrow":
        count = len(np.load(place / name))
        name, damage = embeddings(np.zeros((count, 3), np.float32))
    damage(place)
    command = ["search", "a person walks", "--in", str(tmp_path / "copy"), "--models", str(pipeline / "models")]
    assert main([*command, "--device", "cpu"]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"error: {place / name}")
    assert error.endswith("run `motionary index` again\n")
    assert error.count("\n") == 1


@pytest.mark.parametrize("value", [np.nan, 3e38])
def test_embeddings_that_are_not_finite_are_told(value, indexed, pipeline, tmp_path, capsys):
    shutil.copytree(indexed, tmp_path / "copy")
    path = tmp_path / "copy" / ".motionary" / "index" / "embeddings.npy"
    np.save(path, np.full_like(np.load(path), value))
    command = ["search", "a person walks", "--in", str(tmp_path / "copy"), "--models", str(pipeline / "models")]
    assert main([*command, "--device", "cpu"]) == 2
    assert capsys.readouterr().err.startswith(f"error: {path}: numbers that are not finite")


@pytest.mark.parametrize("name", ["index.json", "clips.parquet", "windows.parquet", "embeddings.npy"])
def test_a_file_that_is_gone_is_named(name, indexed, tmp_path):
    shutil.copytree(indexed, tmp_path / "copy")
    (tmp_path / "copy" / ".motionary" / "index" / name).unlink()
    with pytest.raises(InputError, match="no index" if name == "index.json" else name):
        Archive(tmp_path / "copy")


@pytest.mark.parametrize("name", ["clips", "windows"])
def test_equal_rows_are_counted_before_they_are_unpacked(name, indexed, tmp_path):
    shutil.copytree(indexed, tmp_path / "copy")
    path = tmp_path / "copy" / ".motionary" / "index" / f"{name}.parquet"
    row = pq.read_table(path).slice(0, 1)
    pq.write_table(pa.concat_tables([row] * 1000).combine_chunks(), path)
    row = pq.read_table(path)
    with pq.ParquetWriter(path, row.schema) as writer:
        writer.write_table(pa.concat_tables([row] * 3000), row_group_size=3_000_000)
    assert path.stat().st_size < 1_000_000
    tracemalloc.start()
    before = pa.total_allocated_bytes()
    with pytest.raises(InputError, match=r"3,000,000 rows, of which there must be"):
        Archive(tmp_path / "copy")
    assert tracemalloc.get_traced_memory()[1] < 10_000_000
    tracemalloc.stop()
    assert pa.total_allocated_bytes() - before < 10_000_000
