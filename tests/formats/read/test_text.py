"""What programs do to the text of a BVH file: encodings, ends, rates, channels that nobody fills."""

from __future__ import annotations

import re

import numpy as np
import pytest

from motionary.errors import InputError
from motionary.formats import read_motion
from motionary.formats.read import read_motion_with
from motionary.formats.read.bvh import read_bvh
from motionary.formats.write.bvh_writer import write_bvh
from motionary.motion import Motion, Skeleton

SMALL = """HIERARCHY
ROOT {hip}
{{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT {knee} {{ OFFSET 0 -40 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site {{ OFFSET 0 -45 0 }} }}
}}
MOTION
Frames: 2
Frame Time: 0.04
0 90 0 0 0 0 0 0 0
0 90 5 0 0 0 0 90 0
"""
PLAIN = SMALL.format(hip="hip", knee="knee")


@pytest.mark.parametrize(
    ("encoding", "names"),
    [
        ("utf-8", ("hanche", "genou gauche é")),
        ("utf-8-sig", ("腰", "左ひざ")),
        ("utf-16", ("腰", "左ひざ")),
        ("utf-16-le", ("hip", "knee")),
        ("utf-16-be", ("hip", "knee")),
        ("cp932", ("下半身", "左ひざ")),
        ("latin-1", ("Hüfte", "genou côté é")),
    ],
)
def test_names_survive_their_encoding(tmp_path, encoding, names):
    (tmp_path / "a.bvh").write_bytes(SMALL.format(hip=names[0], knee=names[1]).encode(encoding))
    assert read_bvh(tmp_path / "a.bvh", unit="cm").skeleton.joints == (*names, f"{names[1]}_end")


@pytest.mark.parametrize("end", ["\x1a", "\r\n\x1a\r\n", "\n\n", "\x00\x00", "   "])
def test_what_stands_after_the_last_number(tmp_path, end):
    (tmp_path / "a.bvh").write_text(PLAIN.rstrip() + end)
    assert read_bvh(tmp_path / "a.bvh", unit="cm").frames == 2


@pytest.mark.parametrize("milliseconds", [8.3333, 33.333, 100, 1000])
def test_frame_times_in_milliseconds_are_named(tmp_path, milliseconds):
    (tmp_path / "a.bvh").write_text(PLAIN.replace("0.04", f"{milliseconds}"))
    with pytest.raises(InputError, match=r"Frame Time.*milliseconds.*--fps"):
        read_bvh(tmp_path / "a.bvh")
    assert read_bvh(tmp_path / "a.bvh", fps=30).fps == 30


def test_slow_rates_are_rates(tmp_path):
    (tmp_path / "a.bvh").write_text(PLAIN.replace("0.04", "1"))
    assert read_bvh(tmp_path / "a.bvh").fps == 1


def test_position_channels_that_nobody_filled(tmp_path):
    """Six channels on a joint, positions zero in every frame: the OFFSET says where it is."""
    six = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
    text = PLAIN.replace("CHANNELS 3 Zrotation Xrotation Yrotation", six)
    empty = re.sub(r"(0 90 [05] 0 0 0) (0 9?0 0)", r"\1 0 0 0 \2", text)
    (tmp_path / "a.bvh").write_text(empty)
    (tmp_path / "b.bvh").write_text(PLAIN)
    one, other = (read_bvh(tmp_path / name, unit="cm") for name in ("a.bvh", "b.bvh"))
    np.testing.assert_allclose(one.positions, other.positions, atol=1e-6)
    filled = re.sub(r"(0 90 [05] 0 0 0) (0 9?0 0)", r"\1 0 -30 0 \2", text)
    (tmp_path / "a.bvh").write_text(filled)
    moved = read_bvh(tmp_path / "a.bvh", unit="cm")
    np.testing.assert_allclose(moved.positions[0, 1], [0, 0.6, 0], atol=1e-6)


def test_position_channels_that_are_displacements(tmp_path, person):
    """Channels below the root that stay near zero beside long OFFSETs are added to them, and that is said."""
    write_bvh(person, tmp_path / "a.bvh")
    head, rows = (tmp_path / "a.bvh").read_text().split("Frame Time:")
    rate, *rows = rows.strip().splitlines()
    six = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
    head = head.replace("CHANNELS 3 Zrotation Xrotation Yrotation", six)
    rng, numbers = np.random.default_rng(0), np.array([row.split() for row in rows], float)
    below = numbers[:, 6:].reshape(len(rows), -1, 3)
    noise = rng.normal(0, 0.01, below.shape)
    filled = np.concatenate([numbers[:, :6], np.concatenate([noise, below], -1).reshape(len(rows), -1)], axis=1)
    text = "\n".join(" ".join(f"{x:.6f}" for x in row) for row in filled)
    (tmp_path / "b.bvh").write_text(f"{head}Frame Time: {rate}\n{text}\n")
    moved, reading = read_motion_with(tmp_path / "b.bvh")
    assert any("added to OFFSET" in note for note in reading.notes)
    np.testing.assert_allclose(moved.positions, person.positions, atol=5e-3)


def test_a_joint_that_is_called_like_an_end_site_stays_a_joint(tmp_path):
    skeleton = Skeleton.from_rig("r", ("Hips", "Head", "Head_end", "Tail_end"), (-1, 0, 1, 0), np.eye(4)[:, :3])
    rotations = np.tile([0.0, 0, 0, 1], (3, 4, 1))
    rotations[:, 2:] = [0.6, 0, 0, 0.8]
    motion = Motion(np.random.default_rng(0).normal(size=(3, 4, 3)), 20, skeleton, rotations)
    write_bvh(motion, tmp_path / "a.bvh")
    again = read_bvh(tmp_path / "a.bvh", unit="cm", up="y", mirror=False, skip_first=False)
    assert again.skeleton.joints == skeleton.joints
    np.testing.assert_allclose(np.abs(again.rotations), np.abs(rotations), atol=1e-4)


@pytest.mark.parametrize("length", ["nan", "-1", "0", "inf"])
def test_a_length_unit_of_an_asf_must_be_one(tmp_path, length):
    asf = (
        f":units\n  length {length}\n:root\n  order TX\n:bonedata\nbegin\nname a\nend\n:hierarchy\nbegin\nroot a\nend\n"
    )
    (tmp_path / "a.asf").write_text(asf)
    (tmp_path / "a.amc").write_text("1\nroot 1\n")
    with pytest.raises(InputError, match=r"a\.asf, line 2"):
        read_motion(tmp_path / "a.amc")
