"""What is not believed of a file: each kind of damage is one line that names the file and the rule."""

from __future__ import annotations

import io
import json
import struct
import zipfile

import numpy as np
import pytest

from motionary.errors import InputError
from motionary.formats import read_motion, write_motion
from motionary.formats.read import __name__ as reading
from motionary.motion import Motion, Skeleton, resample


def _npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def _archive(path, method=zipfile.ZIP_DEFLATED, **members: bytes):
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, data in members.items():
            archive.writestr(f"{name}.npy", data)
    return path


def _refused(path, rule: str) -> None:
    with pytest.raises(InputError, match=rule) as caught:
        read_motion(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


GOOD = np.zeros((4, 22, 3), np.float32)


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_zip_members_that_numpy_never_writes(tmp_path, method):
    _refused(_archive(tmp_path / "a.npz", method, positions=_npy(GOOD)), "stored or deflated")


@pytest.mark.parametrize(
    ("place", "value", "rule"), [(8, 1, "encrypted"), (10, 99, "compression 99"), (8, 32, "patched")]
)
def test_zip_flags_and_methods(tmp_path, place, value, rule):
    """The list of members says: encrypted, a method that nobody has, patched data."""
    path = _archive(tmp_path / "a.npz", positions=_npy(GOOD))
    data = bytearray(path.read_bytes())
    data[data.find(b"PK\x01\x02") + place] = value
    path.write_bytes(data)
    _refused(path, rule)


def test_a_damaged_stream_and_a_wrong_checksum(tmp_path):
    path = _archive(tmp_path / "a.npz", positions=_npy(np.random.default_rng(0).normal(size=(4, 22, 3))))
    data = bytearray(path.read_bytes())
    data[200] ^= 0xFF
    path.write_bytes(data)
    _refused(path, "a.npz, positions")
    stored = _archive(tmp_path / "b.npz", zipfile.ZIP_STORED, positions=_npy(GOOD))
    data = bytearray(stored.read_bytes())
    data[300] ^= 0xFF
    stored.write_bytes(data)
    _refused(stored, "CRC")


@pytest.mark.parametrize(
    ("array", "rule"),
    [
        (GOOD.astype(complex), "real numbers"),
        (GOOD.astype("U5"), "real numbers"),
        (np.zeros((4, 22), [("x", "f4"), ("y", "f4")]), "real numbers"),
        (GOOD.astype("M8[s]"), "real numbers"),
        (np.full((4, 22, 3), 1e30), "1e\\+07 m|1e\\+07"),
        (np.full((4, 22, 3), np.nan), "finite"),
    ],
)
def test_values_that_are_no_places(tmp_path, array, rule):
    (tmp_path / "a.npy").write_bytes(_npy(array))
    _refused(tmp_path / "a.npy", rule)


@pytest.mark.parametrize("shape", [(10**30, 22, 3), (2**62, 22, 3), (10**6, 22, 3), (-4, 22, 3), (5, 22, 3)])
def test_a_header_that_claims_more_than_there_is(tmp_path, shape):
    header = f"{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}\n"
    data = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + GOOD.tobytes()
    (tmp_path / "a.npy").write_bytes(data)
    _refused(tmp_path / "a.npy", "shape|holds|below 0|may have|length")


def test_a_header_that_is_cut(tmp_path):
    data = _npy(GOOD)
    for length in range(1, 128, 9):
        (tmp_path / "a.npy").write_bytes(data[:length])
        _refused(tmp_path / "a.npy", "damaged")


def test_fortran_order_and_big_endian_are_read(tmp_path):
    """The opener is numpy's own reading: same values for every order and width."""
    walk = np.random.default_rng(0).normal(size=(4, 22, 3))
    for array in (np.asfortranarray(walk), walk.astype(">f8"), walk.astype("<f2"), walk.astype(np.float128)):
        (tmp_path / "a.npy").write_bytes(_npy(array))
        _archive(tmp_path / "a.npz", positions=_npy(array))
        for path in (tmp_path / "a.npy", tmp_path / "a.npz"):
            read = read_motion(path, up="y", unit=1.0, mirror=False).positions
            np.testing.assert_array_equal(read, array.astype(np.float32))


@pytest.mark.parametrize("text", ["[" * 100_000, '{"name": []}', "{", "1" * 5000])
def test_skeletons_that_are_none(tmp_path, text):
    _refused(_archive(tmp_path / "a.npz", positions=_npy(GOOD), skeleton=_npy(np.array(text))), "a.npz")


@pytest.mark.parametrize(
    ("key", "value"), [("name", ["a"]), ("name", "\ud83d"), ("joints", [1] * 22), ("name", "n" * 999)]
)
def test_names_that_no_file_can_hold(tmp_path, key, value):
    skeleton = {**Skeleton.named("smpl22").to_json(), key: value}
    text = _npy(np.array(json.dumps(skeleton)))
    _refused(_archive(tmp_path / "a.npz", positions=_npy(GOOD), skeleton=text), "Unicode text")


@pytest.mark.parametrize("rate", [1e-300, 1e300, 0.1, 0.0, -5.0, np.nan])
def test_rates_that_no_motion_has(tmp_path, rate):
    _refused(_archive(tmp_path / "a.npz", positions=_npy(GOOD), fps=_npy(np.array(rate))), "frames per second")


@pytest.mark.parametrize("time", ["1e-320", "1e-9", "1e300", "33.3"])
def test_frame_times_that_no_motion_has(tmp_path, person, time):
    path = write_motion(person, tmp_path / "a.bvh")
    path.write_text(path.read_text().replace("Frame Time: 0.050000000", f"Frame Time: {time}"))
    _refused(path, "Frame Time: .* must be seconds per frame|frame time must be")


def test_a_line_that_holds_a_whole_hierarchy(tmp_path, person):
    """Words are passed once: a line of a hundred thousand OFFSETs was read in minutes."""
    path = write_motion(person, tmp_path / "a.bvh")
    head, motion = path.read_text().split("MOTION")
    path.write_text(" ".join(head.split()) + "\nMOTION" + motion)
    assert read_motion(path).frames == person.frames
    many = head.replace("OFFSET", "OFFSET 1 2 3 " * 100_000 + "OFFSET", 1)
    path.write_text(" ".join(many.split()) + "\nMOTION" + motion)
    assert read_motion(path).frames == person.frames


def test_few_numbers_for_many_joints(tmp_path):
    """A root alone that moves, of 400 joints, takes two bytes a frame: the file does not say how much it unpacks to."""
    joints = "JOINT j { OFFSET 0 1 0 CHANNELS 0 " * 400 + "} " * 400
    text = (
        "HIERARCHY ROOT r { OFFSET 0 0 0 CHANNELS 1 Xposition " + joints + "}\nMOTION\nFrames: 9000\nFrame Time: 0.05\n"
    )
    (tmp_path / "a.bvh").write_text(text + "0\n" * 9000)
    _refused(tmp_path / "a.bvh", "9,000 frames of 401 joints: .*cut it into parts")


def test_resampling_is_limited(person):
    slow = Motion(np.repeat(person.positions, 10, axis=0), 0.5, person.skeleton)
    with pytest.raises(InputError, match="frames; at most 1,000,000 joints x frames"):
        resample(slow, 10_000.0)


def test_what_nobody_foresaw_is_one_line(tmp_path, monkeypatch):
    """A reader that fails by itself is told with the file and the kind of its failure."""

    def broken(path, options=None, fps=None):
        raise ZeroDivisionError("nobody\nforesaw this")

    monkeypatch.setattr(f"{reading}.function_of", lambda *_: broken)
    (tmp_path / "a.bvh").write_text("x")
    _refused(tmp_path / "a.bvh", "a.bvh: ZeroDivisionError: nobody foresaw this: cannot be read")
