"""Rates that rounded frame times mean."""

from __future__ import annotations

import re

import numpy as np
import pytest
from postures import person, written

from motionary.formats.read import read_motion_with
from motionary.formats.read.frame_rate import rate_of, rounding


@pytest.mark.parametrize(
    ("text", "fps", "told"),
    [
        ("0.0333333", 30, False), ("0.033333", 30, False), ("0.0333", 30, False), ("0.033", 30, False),
        ("0.03", 30, True), ("0.0083333", 120, False), ("0.00833", 120, False), ("0.0083", 120, False),
        ("0.0167", 60, False), ("0.017", 60, False), ("0.016667", 60, False), ("0.0042", 240, False),
        ("0.042", 24, False), ("0.041667", 24, False), ("0.04", 25, False), ("0.02", 50, False),
        ("0.01", 100, False), ("0.05", 20, False), ("0.1", 10, False), ("8.333333e-03", 120, False),
        ("0.008", 125, True), ("0.0334", 30000 / 1001, False), ("0.0333667", 30000 / 1001, False),
        ("0.016683", 60000 / 1001, False), ("0.136986301", 7.3, False), ("0.033003300", 30.3, False),
    ],
)  # fmt: skip
def test_the_rate_that_is_meant_is_taken_and_a_far_one_told(text, fps, told):
    found, note = rate_of(float(text), rounding(text))
    assert found == pytest.approx(fps, rel=1e-6)
    assert bool(note) == told
    assert not told or f"{float(text):g}" in note


@pytest.mark.parametrize("fps", [7.3, 23.976, 24, 29.97, 30, 59.94, 60, 90, 119.88, 120, 123.4, 240])
def test_six_digits_and_more_are_never_moved(fps):
    for digits in (7, 8, 9):
        text = f"{1 / fps:.{digits}f}"
        assert rate_of(float(text), rounding(text))[0] == pytest.approx(fps, rel=5e-4)


def test_a_file_with_commas_for_points_is_read_as_it_is_meant(tmp_path):
    text = written(*person("stands"), "y", "t")
    (tmp_path / "points.bvh").write_text(text)
    (tmp_path / "commas.bvh").write_text(text.replace(".", ","))
    head, rows = re.split(r"(?<=MOTION)", text)
    (tmp_path / "rows.bvh").write_text(head + rows.replace(".", ","))
    wanted, _ = read_motion_with(tmp_path / "points.bvh")
    for name in ("commas.bvh", "rows.bvh"):
        found, _ = read_motion_with(tmp_path / name)
        assert found.fps == wanted.fps
        np.testing.assert_allclose(found.positions, wanted.positions, atol=1e-6)


def test_angles_that_may_be_radians_are_told(tmp_path):
    world, root = person("stands")
    text = written(world, root, "y", "t")
    (tmp_path / "degrees.bvh").write_text(text)
    head, rows = re.split(r"(?<=Frame Time: 0\.05)0*\n", text)
    numbers = np.array([line.split() for line in rows.splitlines()], float)
    numbers[:, 3:] = np.radians(numbers[:, 3:])
    lines = "\n".join(" ".join(f"{x:.6f}" for x in row) for row in numbers)
    (tmp_path / "radians.bvh").write_text(f"{head}\n{lines}\n")
    for name, told in (("degrees", False), ("radians", True)):
        _, reading = read_motion_with(tmp_path / f"{name}.bvh")
        assert any("2 pi" in note for note in reading.notes) == told


def test_a_rate_in_place_of_the_frame_time_is_named(tmp_path):
    text = written(*person("stands"), "y", "t")
    (tmp_path / "a.bvh").write_text(re.sub(r"Frame Time: .*", "Frame Time: 30", text))
    with pytest.raises(ValueError, match=r"Frame Time: 30: must be seconds per frame.*or a rate\? then fps=30"):
        read_motion_with(tmp_path / "a.bvh")
