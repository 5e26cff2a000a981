"""Files with a hole of gigabytes, as a copy that was cut off leaves them: one clear line, and memory for a piece.

The holes take no disk, and none of the limits depends on how fast a machine is.
"""

from __future__ import annotations

import io
import json
import os
import struct
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from acclaim_files import HEADER

from motionary.corpus.sources import FolderSource
from motionary.errors import InputError
from motionary.formats import number_rows, read_motion, write_motion
from motionary.formats.gltf_file import GltfFile
from motionary.formats.number_rows import text_lines
from motionary.formats.read.acclaim import read_amc
from motionary.formats.read.bvh import read_bvh

HOLE = 2_500_000_000  # bytes
BONE = "begin\nid 1\nname leg\ndirection 0 1 0\nlength 2\naxis 0 0 20 XYZ\ndof rx ry rz\nend\n"
ASF = f"{HEADER}:bonedata\n{BONE}:hierarchy\nbegin\nroot leg\nend\n"
AMC = "".join(f"{t}\nroot 0 1 2 3 4 5\nleg 1 2 3\n" for t in (1, 2))


@contextmanager
def little_memory(most: float = 128e6) -> Iterator[None]:
    """What the block takes at once stays below so many bytes."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < most
    finally:
        tracemalloc.stop()


def holed(path: Path, before: bytes, after: bytes = b"") -> Path:
    """A file with a hole between two texts."""
    with path.open("wb") as file:
        file.write(before)
        file.truncate(HOLE)
        file.seek(0, 2)
        file.write(after)
    return path


@pytest.fixture
def bvh(person, tmp_path) -> bytes:
    return write_motion(person, tmp_path / "good.bvh").read_bytes()


BVH: dict[str, tuple[Callable[[bytes], tuple[bytes, bytes]], str]] = {
    "in the head": (lambda t: (b"HIERARCHY\n", b"x\n"), "no 'Frame Time:' in 4,194,304 bytes: .*starts with HIERARCHY"),
    "in the first frame": (lambda t: (t[: t.index(b"Frame Time")] + b"Frame Time: 0.05\n", b"x\n"), "line 1.*frame 1 "),
    "in a later frame": (lambda t: (t[:-3000], t[-3000:]), "more than 16,777,216 bytes: frame .* must hold"),
    "after the text": (lambda t: (t, b""), "67,108,864 bytes of filling"),
    "in UTF-16": (lambda t: (t.decode().encode("utf-16"), b"x\n"), "bytes: a text in UTF-16 may have 134,217,728"),
}


@pytest.mark.parametrize("kind", BVH)
def test_a_bvh_with_a_hole(tmp_path, person, bvh, kind):
    change, rule = BVH[kind]
    path = holed(tmp_path / "hole.bvh", *change(bvh))
    with little_memory(), pytest.raises(InputError, match=rf"hole\.bvh.*{rule}"):
        read_bvh(path)
    with little_memory(), pytest.raises(InputError, match=rf"hole\.bvh.*{rule}"):
        write_motion(person, tmp_path / "out.bvh", onto=path)


def test_a_head_of_many_lines(tmp_path):
    (tmp_path / "a.bvh").write_bytes(b"HIERARCHY\n" + b"ROOT a { OFFSET 0 0 0\n" * 200_000)
    with little_memory(), pytest.raises(InputError, match=r"a\.bvh: no 'Frame Time:' in 4,194,304 bytes"):
        read_bvh(tmp_path / "a.bvh")


@pytest.mark.parametrize(
    ("which", "after", "rule"),
    [
        ("asf", "", r"a\.asf: 2,500,000,000 bytes: such a text may have 4,194,304"),
        ("amc", "", r"a\.amc: 67,108,864 bytes of filling"),
        ("amc", "\n3\n", r"a\.amc, line 7: more than 16,777,216 bytes: must be a bone and its values"),
    ],
)
def test_acclaim_files_with_a_hole(tmp_path, which, after, rule):
    texts = {"asf": ASF, "amc": AMC}
    for extension, text in texts.items():
        (tmp_path / f"a.{extension}").write_text(text)
    assert read_amc(tmp_path / "a.amc", unit="cm").frames == 2
    holed(tmp_path / f"a.{which}", texts[which].encode(), after.encode())
    with little_memory(), pytest.raises(InputError, match=rule):
        read_amc(tmp_path / "a.amc")


@pytest.mark.parametrize("end", ["\n", "\r", "\r\n"])
def test_a_hole_in_a_listing_is_one_problem_and_the_rest_stays(tmp_path, person, end):
    for name in ("a", "b", "c"):
        write_motion(person, tmp_path / f"{name}.npz")
    lines = [json.dumps({"motion": f"{name}.npz"}) + end for name in ("a", "b", "c")]
    listing = tmp_path / "clips.jsonl"
    with listing.open("wb") as file:
        file.write(lines[0].encode())
        file.truncate(100_000_000)
        file.seek(0, 2)
        file.write("".join([end, *lines[1:]]).encode())
    with little_memory():
        clips, problems = FolderSource(tmp_path, "x").clips()
    assert [clip.id for clip in clips] == ["x/a", "x/b", "x/c"]
    assert [str(p) for p in problems] == [f"{listing}:2: more than 16,777,216 bytes: {problems[0].rule}"]
    assert "one JSON object per line" in problems[0].rule


def test_of_a_listing_no_more_is_read_than_one_may_have(tmp_path, person):
    write_motion(person, tmp_path / "a.npz")
    (tmp_path / "clips.jsonl").write_text('{"motion": "a.npz"}\n')
    os.truncate(tmp_path / "clips.jsonl", 1 << 40)  # no machine could read it all
    with little_memory():
        clips, problems = FolderSource(tmp_path, "x").clips()
    assert [clip.id for clip in clips] == ["x/a"]
    assert "1,099,511,627,776 bytes: a listing may have 536,870,912; what follows is left out" in str(problems[0])


@pytest.mark.parametrize("piece", [1, 2, 3, 5, 8, 100])
def test_long_lines_are_cut_wherever_pieces_fall(monkeypatch, piece):
    monkeypatch.setattr(number_rows, "PIECE", piece)
    monkeypatch.setattr(number_rows, "LONGEST_LINE", 10)
    for end in (b"\n", b"\r", b"\r\n"):
        lines = [b"first", b"", b"x" * 50, b"", b"second", b"y" * 30, b"z" * 11, b"last"]
        text = end.join(lines)
        found = list(text_lines(io.BytesIO(text), len(text)))
        assert len(found) == len(lines)
        for cut, line in zip(found, lines, strict=True):
            assert cut.strip() == line if len(line) < 10 else line.startswith(cut.strip()) and len(cut) > 10


def test_lines_longer_than_a_piece_take_time_for_what_they_are(tmp_path, monkeypatch, bvh):
    """A line that begins where a piece ends is not carried on whole: numbers are read up to its last space."""
    monkeypatch.setattr(number_rows, "PIECE", 64)
    head, numbers = bvh.split(b"Frame Time: ")
    time, *words = numbers.split()
    text = b"%bFrame Time: %b\n%b\n%b\n" % (head, time, b" ".join(words[:100]), b" ".join(words[100:]))
    longest, given = 0, number_rows.numbers_of

    def numbers_of(some: bytes) -> np.ndarray:
        """Notes how much is taken at once."""
        nonlocal longest
        longest = max(longest, len(some))
        return given(some)

    monkeypatch.setattr(number_rows, "numbers_of", numbers_of)
    (tmp_path / "a.bvh").write_bytes(text)
    assert np.array_equal(read_bvh(tmp_path / "a.bvh").positions, read_bvh(tmp_path / "good.bvh").positions)
    assert longest < 200


def in_a_hole(path: Path, document: dict, data: bytes) -> Path:
    """A .glb file whose buffer goes on for gigabytes."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    size = len(data) + HOLE
    head = b"glTF" + struct.pack("<III", 2, 28 + len(text) + size, len(text)) + b"JSON" + text
    with path.open("wb") as file:
        file.write(head + struct.pack("<I", size) + b"BIN\0" + data)
        file.truncate(file.tell() + HOLE)
    return path


@pytest.fixture
def glb(person, tmp_path) -> GltfFile:
    return GltfFile.read(write_motion(person, tmp_path / "good.glb"))


def test_of_a_gltf_buffer_only_what_moves_is_read(tmp_path, glb):
    """Meshes, images and holes take neither time nor memory."""
    good = read_motion(glb.path)
    hole = in_a_hole(tmp_path / "hole.glb", glb.document, glb.data)
    holed(tmp_path / "hole.bin", glb.data)
    document = glb.document | {"buffers": [{"uri": "hole.bin", "byteLength": HOLE}]}
    (tmp_path / "hole.gltf").write_text(json.dumps(document))
    for path in (hole, tmp_path / "hole.gltf"):
        with little_memory():
            found = read_motion(path)
        np.testing.assert_array_equal(found.positions, good.positions)


def test_a_character_with_a_hole_is_refused_by_name(tmp_path, person, glb):
    path = in_a_hole(tmp_path / "hole.glb", glb.document, glb.data)
    rule = r"hole\.glb, buffer 0: 2,50\d,\d+,\d+ bytes: a character's may have 268,435,456"
    with little_memory(), pytest.raises(InputError, match=rule):
        write_motion(person, tmp_path / "out.glb", onto=path)
    assert not (tmp_path / "out.glb").exists()


@pytest.mark.parametrize(("count", "stride"), [(200_000_000, 12), (15_000_000, 12), (2_000_000, 1000)])
def test_keys_in_a_hole_are_not_read(tmp_path, glb, count, stride):
    document, start = json.loads(json.dumps(glb.document)), len(glb.data)
    sampler = document["animations"][0]["samplers"][0]
    document["bufferViews"].append(
        {"buffer": 0, "byteOffset": start, "byteLength": count * stride, "byteStride": stride}
    )
    document["accessors"].append(
        {"bufferView": len(document["bufferViews"]) - 1, "componentType": 5126, "count": count, "type": "VEC3"}
    )
    sampler["output"] = len(document["accessors"]) - 1
    path = in_a_hole(tmp_path / "hole.glb", document, glb.data)
    with little_memory(), pytest.raises(InputError, match=r"hole\.glb, animation motion, channel 0, output: .*parts"):
        read_motion(path)


def test_a_file_may_hold_so_many_numbers(tmp_path, glb, monkeypatch):
    monkeypatch.setattr("motionary.formats.gltf_file._MOST_NUMBERS", 100)
    with pytest.raises(InputError, match=r"good\.glb, .*channel.*may be 16,777,216 numbers, 100 with all others"):
        read_motion(glb.path)
