"""ASF and AMC: positions known in closed form, and broken files."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.errors import InputError
from motionary.formats import read_motion
from motionary.formats.read.acclaim import read_amc

CMU = 0.0254 / 0.45
ASF = """# a hip, a leg of two bones and a spine
:version 1.10
:name TEST
:units
  mass 1.0
  length 0.45
  angle deg
:documentation
  nothing
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     id 1
     name lfemur
     direction 0 -1 0
     length 8
     axis 0 0 90  XYZ
     dof rx ry rz
     limits (-160.0 20.0)
            (-70.0 70.0)
            (-60.0 70.0)
  end
  begin
     id 2
     name ltibia
     direction 0 -2 0
     length 7
     axis 0 0 0  XYZ
     dof rx
  end
  begin
     id 3
     name lowerback
     direction 0 1 0
     length 2
     axis 0 0 0  XYZ
  end
:hierarchy
  begin
    root lfemur lowerback
    lfemur ltibia
  end
"""
AMC = """#!OML:ASF test
:FULLY-SPECIFIED
:DEGREES
1
root 1 15 3 0 0 0
lfemur 0 0 0
ltibia 0
2
root 1 15 3 0 90 0
lfemur 0 -90 0
ltibia 90
"""


@pytest.fixture
def pair(tmp_path):
    (tmp_path / "02.asf").write_text(ASF)
    (tmp_path / "02_01.amc").write_text(AMC)
    return tmp_path / "02_01.amc"


def test_positions_in_closed_form(pair):
    motion = read_motion(pair)
    assert motion.fps == 120
    assert motion.skeleton.joints == ("root", "lfemur", "lowerback", "ltibia", "lowerback_end", "ltibia_end")
    rest = [[1, 15, 3], [1, 15, 3], [1, 15, 3], [1, 7, 3], [1, 17, 3], [1, 0, 3]]
    np.testing.assert_allclose(motion.positions[0], np.array(rest) * CMU, atol=1e-6)
    # The femur's own y axis (its axis turns y to -x) by -90 degrees turns its -y bone to +z... in the root's frame:
    # C = Rz(90); M = Ry(-90); C M C^-1 turns about C y = -x by -90, so about x by 90: -y becomes -z. The tibia's
    # further 90 about x makes it +y. The root's Ry(90) turns -z into -x.
    moved = [[1, 15, 3], [1, 15, 3], [1, 15, 3], [-7, 15, 3], [1, 17, 3], [-7, 22, 3]]
    np.testing.assert_allclose(motion.positions[1], np.array(moved) * CMU, atol=1e-6)


def test_two_axes_turn_in_the_order_of_the_dof(pair):
    pair.write_text(AMC.replace("lfemur 0 0 0", "lfemur 90 0 90", 1))
    # C = Rz(90); M = Rz(90) Rx(90): x first. C M C^-1 of -y: C^-1 -> -x; Rx -> -x; Rz -> -y; C -> +x.
    motion = read_amc(pair)
    np.testing.assert_allclose(motion.positions[0, 3], np.array([9, 15, 3]) * CMU, atol=1e-6)


def test_rotations_are_true(pair):
    from motionary.motion import forward_kinematics

    motion = read_amc(pair, fps=60, unit="cm")
    assert motion.fps == 60
    again = forward_kinematics(motion.skeleton, motion.rotations, motion.positions[:, 0])
    np.testing.assert_allclose(again, motion.positions, atol=1e-6)
    np.testing.assert_allclose(motion.positions[0, 3], [0.01, 0.07, 0.03], atol=1e-6)


def test_radians(pair):
    text = AMC.replace(":DEGREES", ":RADIANS").replace(" 90", f" {np.pi / 2}").replace(" -90", f" {-np.pi / 2}")
    degrees = read_amc(pair)
    pair.write_text(text)
    np.testing.assert_allclose(read_amc(pair).positions, degrees.positions, atol=1e-6)


BROKEN = {
    "unknown bone": ("amc", "ltibia 90", "lshin 90", "line 11"),
    "missing values": ("amc", "ltibia 90", "ltibia", "line 11"),
    "word": ("amc", "ltibia 90", "ltibia ninety", "numbers"),
    "nan": ("amc", "ltibia 90", "ltibia nan", "finite"),
    "truncated": ("amc", "ltibia 90\n", "", "frame 2 lacks"),
    "no frames": ("amc", AMC[AMC.index("1\n") :], "", "frames"),
    "bone before a frame": ("amc", "1\nroot", "root", "frame number"),
    "length word": ("asf", "length 8", "length long", "line 20"),
    "dof": ("asf", "dof rx\n", "dof tx\n", "line 33.*rx, ry"),
    "axis": ("asf", "axis 0 0 90  XYZ", "axis 0 0 90  XXZ", "line 21.*order of X"),
    "hierarchy": ("asf", "lfemur ltibia", "lfemur lshin", "names no bone"),
    "circle": ("asf", "lfemur ltibia\n", "lfemur ltibia\n ltibia lfemur\n", "one parent"),
    "orphan": ("asf", "    lfemur ltibia\n", "", "hierarchy"),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_broken_files_name_file_and_rule(tmp_path, kind):
    which, old, new, expected = BROKEN[kind]
    texts = {"asf": ASF, "amc": AMC}
    assert old in texts[which]
    texts[which] = texts[which].replace(old, new, 1)
    for extension, text in texts.items():
        (tmp_path / f"x.{extension}").write_text(text)
    with pytest.raises(InputError, match=rf"x\.{which}.*{expected}"):
        read_amc(tmp_path / "x.amc")


def test_missing_skeleton(tmp_path):
    (tmp_path / "x.amc").write_text(AMC)
    with pytest.raises(InputError, match=r"x\.asf"):
        read_amc(tmp_path / "x.amc")
