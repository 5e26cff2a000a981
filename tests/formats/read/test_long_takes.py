"""Long takes: memory bounded by the file's size, pieces that fall anywhere, and a bar where one is asked for."""

from __future__ import annotations

import subprocess
import sys
import time

import numpy as np
import pytest
from acclaim_files import HEADER

from motionary.cli import main
from motionary.errors import InputError
from motionary.formats import number_rows, read_motion, write_motion
from motionary.formats.read.acclaim import read_amc
from motionary.formats.read.bvh import read_bvh

PEAK = """
import sys
from pathlib import Path
from motionary.formats import read_motion
def held(what):
    return int(Path("/proc/self/status").read_text().split(f"{what}:")[1].split()[0]) * 1024
read_motion(sys.argv[1], up="y", unit="cm", mirror=False)
before = held("VmHWM")
motion = read_motion(sys.argv[2], up="y", unit="cm", mirror=False)
print(motion.frames, len(motion.skeleton), held("VmHWM") - before)
"""


def peak(small, long) -> list[int]:
    """Frames, joints and the bytes that reading `long` takes more than `small` does, in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", PEAK, str(small), str(long)], capture_output=True, text=True, check=True
    )
    return [int(word) for word in done.stdout.split()]


def bvh(frames: int, joints: int = 73) -> str:
    """A chain of joints that turn all the time, each number of 8 characters."""
    rng = np.random.default_rng(0)
    inner = "".join(f"JOINT j{j} {{ OFFSET 0 2 0 CHANNELS 3 Zrotation Xrotation Yrotation\n" for j in range(1, joints))
    root = "ROOT j0 { OFFSET 0 0 0 CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n"
    head = f"HIERARCHY\n{root}{inner}{'}' * joints}\nMOTION\nFrames: {frames}\nFrame Time: 0.0083333\n"
    rows = [" ".join(f"{x:.4f}" for x in row) for row in rng.uniform(-50, 50, (100, 3 * joints + 3))]
    return head + "\n".join(rows[t % 100] for t in range(frames)) + "\n"


def test_a_long_bvh_takes_twice_its_size_at_most(tmp_path):
    """A minute and a half at 120 frames a second; half an hour of the same is 20 times as long."""
    (tmp_path / "small.bvh").write_text(bvh(3))
    (tmp_path / "long.bvh").write_text(bvh(11_000))
    size = (tmp_path / "long.bvh").stat().st_size
    frames, joints, more = peak(tmp_path / "small.bvh", tmp_path / "long.bvh")
    assert (frames, joints) == (11_000, 73)
    assert more < 2 * size


def amc(folder, frames: int):
    """A chain of 20 bones that turn all the time."""
    bones = [f"bone{i}" for i in range(20)]
    told = "".join(
        f"begin\nid 1\nname {b}\ndirection 0 1 0\nlength 2\naxis 0 0 20 XYZ\ndof rx ry rz\nend\n" for b in bones
    )
    chain = "".join(f"{a} {b}\n" for a, b in zip(["root", *bones], bones, strict=False))
    (folder / "a.asf").write_text(f"{HEADER}:bonedata\n{told}:hierarchy\nbegin\n{chain}end\n")
    angles = np.random.default_rng(0).uniform(-90, 90, (50, 20, 3)).round(4).tolist()
    poses = ["".join(f"{b} {x} {y} {z}\n" for b, (x, y, z) in zip(bones, row, strict=True)) for row in angles]
    path = folder / f"a_{frames}.amc"
    path.write_text(":DEGREES\n" + "".join(f"{t + 1}\nroot 0 15 {t} 0 0 0\n{poses[t % 50]}" for t in range(frames)))
    return path


def test_a_long_amc_takes_twice_its_size_at_most(tmp_path):
    """Twice what a longer take adds: the buffers of one piece, about 10 MB, are the same for every take."""
    small, long = amc(tmp_path, 8_000), amc(tmp_path, 40_000)
    frames, _, more = peak(small, long)
    assert frames == 40_000
    assert more < 2 * (long.stat().st_size - small.stat().st_size)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", " "])
def test_pieces_fall_anywhere(tmp_path, monkeypatch, end):
    """Numbers, lines and rows that go over the border of a piece, also where rows are no lines."""
    text = bvh(7, joints=5)
    head, numbers = text[: text.index("Frame Time")], text[text.index("Frame Time") :].split("\n", 1)
    (tmp_path / "a.bvh").write_text(text)
    whole = read_bvh(tmp_path / "a.bvh", up="y", unit="cm")
    line = "\n" if end == " " else end
    text = head.replace("\n", line) + numbers[0] + line + numbers[1].replace("\n", end)
    (tmp_path / "b.bvh").write_bytes(text.encode())
    for size in (61, 64, 67, 200):
        monkeypatch.setattr(number_rows, "PIECE", size)
        np.testing.assert_array_equal(read_bvh(tmp_path / "b.bvh", up="y", unit="cm").positions, whole.positions)


def test_a_wrong_line_far_into_a_long_file_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(number_rows, "PIECE", 256)
    lines = bvh(60, joints=5).split("\n")
    first = next(i for i, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    wrong = {"word": "1 2 x", "nan": " ".join(["nan"] * 18), "short": "1 2 3"}
    rule = {"word": "frame 51 must hold numbers", "nan": "frame 51 must be finite", "short": "frame 51 must hold 18"}
    for kind, row in wrong.items():
        (tmp_path / "a.bvh").write_text("\n".join([*lines[: first + 50], row, *lines[first + 51 :]]))
        with pytest.raises(InputError, match=f"line {first + 51}: .*{rule[kind]}"):
            read_bvh(tmp_path / "a.bvh")


def test_more_frames_than_said_are_read_over_many_pieces(tmp_path, monkeypatch):
    (tmp_path / "a.bvh").write_text(bvh(90, joints=5))
    whole = read_bvh(tmp_path / "a.bvh", up="y", unit="cm")
    (tmp_path / "b.bvh").write_text(bvh(90, joints=5).replace("Frames: 90", "Frames: 4"))
    monkeypatch.setattr(number_rows, "PIECE", 256)
    np.testing.assert_array_equal(read_bvh(tmp_path / "b.bvh", up="y", unit="cm").positions, whole.positions)


def test_a_bar_tells_how_fast_a_slow_file_is_read(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(number_rows, "SLOW", 0.1)
    path = tmp_path / "a.bvh"
    path.write_bytes(b"0" * 5000)
    for shown, seconds in ((True, 0.15), (True, 0.0), (None, 0.15)):
        with path.open("rb") as file, number_rows.reading_bar(file, path, shown) as told:
            told(2000)
            time.sleep(seconds)
            told(3000)
        said = capsys.readouterr().err
        assert ("a.bvh: 100%" in said and "B/s" in said) == (shown is True and seconds > 0.1), said


def test_the_shell_shows_a_bar_to_people_alone(tmp_path, person, monkeypatch, capsys):
    path = write_motion(person, tmp_path / "a.bvh")
    monkeypatch.setattr(number_rows, "SLOW", 0.0)
    assert main(["convert", str(path), str(tmp_path / "a.npz")]) == 0
    read_motion(path)
    assert "B/s" not in capsys.readouterr().err
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    assert main(["convert", str(path), str(tmp_path / "b.npz")]) == 0
    assert "a.bvh: 100%" in capsys.readouterr().err


def test_an_amc_has_a_bar_too(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(number_rows, "SLOW", 0.0)
    read_amc(amc(tmp_path, 3), progress=True, up="y", mirror=False)
    assert "a_3.amc: 100%" in capsys.readouterr().err
