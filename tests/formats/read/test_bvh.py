"""BVH: against independent kinematics, a second and a third reader, round trips, and every kind of broken file."""

from __future__ import annotations

import os
import re

import numpy as np
import postures
import pytest
from turned import ONTO

from motionary.errors import InputError
from motionary.formats.measure import UNITS
from motionary.formats.read.bvh import bvh_with, read_bvh
from motionary.formats.read.reading_options import ReadingOptions
from motionary.formats.write.bvh_writer import write_bvh
from motionary.motion import Motion, Skeleton
from motionary.motion.rotations import quat_action

CMU = 0.0254 / 0.45


def turn(axis: str, degrees: float) -> np.ndarray:
    """A rotation matrix about one axis."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i = "XYZ".index(axis)
    m = np.eye(3)
    j, k = (i + 1) % 3, (i + 2) % 3
    m[j, j] = m[k, k] = c
    m[j, k], m[k, j] = -s, s
    return m


def random_bvh(rng: np.random.Generator, joints: int = 9, frames: int = 5) -> tuple[str, np.ndarray]:
    """A random tree with random channels on every joint, and its joints (T, J, 3) by plain matrix products."""
    parents = [-1] + [int(rng.integers(0, j)) for j in range(1, joints)]
    offsets = rng.normal(size=(joints, 3)).round(4)
    channels = []
    for j in range(joints):
        names = [f"{a}rotation" for a in rng.permutation(list("XYZ"))]
        if j == 0 or rng.random() < 0.3:
            places = [f"{a}position" for a in rng.permutation(list("XYZ"))[: 3 if j == 0 else int(rng.integers(1, 4))]]
            names = places + names if rng.random() < 0.7 else names + places
        channels.append(names)
    values = [rng.uniform(-170, 170, size=(frames, len(c))).round(4) for c in channels]

    order: list[int] = []

    def block(j: int) -> str:
        order.append(j)
        inside = f"OFFSET {' '.join(map(str, offsets[j]))}\nCHANNELS {len(channels[j])} {' '.join(channels[j])}\n"
        inside += "".join(block(k) for k in range(joints) if parents[k] == j)
        if j not in parents:
            inside += "End Site\n{\nOFFSET 0 0 0\n}\n"
        return f"{'ROOT' if j == 0 else 'JOINT'} j{j}\n{{\n{inside}}}\n"

    text = "HIERARCHY\n" + block(0) + f"MOTION\nFrames: {frames}\nFrame Time: 0.05\n"
    for t in range(frames):
        text += " ".join(str(x) for j in order for x in values[j][t]) + "\n"
    positions = np.zeros((frames, joints, 3))
    for t in range(frames):
        world = {}
        for j in order:
            rotation, place = np.eye(3), offsets[j].copy()
            for name, value in zip(channels[j], values[j][t], strict=True):
                if name.endswith("rotation"):
                    rotation = rotation @ turn(name[0], value)
                else:
                    place["XYZ".index(name[0])] = value
            above, origin = world.get(parents[j], (np.eye(3), np.zeros(3)))
            world[j] = above @ rotation, origin + above @ place
            positions[t, j] = world[j][1]
    return text, positions[:, order]


@pytest.mark.parametrize("seed", range(8))
def test_any_channels_on_any_joint_follow_the_matrices(tmp_path, seed):
    text, expected = random_bvh(np.random.default_rng(seed))
    path = tmp_path / "a.bvh"
    path.write_text(text)
    motion = read_bvh(path, unit="m", up="y", skip_first=False)
    root = expected.shape[1] - len(motion.skeleton.joints)  # a root above one moving joint is folded into it
    assert motion.fps == 20
    np.testing.assert_allclose(motion.positions, expected[:, root:], atol=2e-4, rtol=1e-5)
    write_bvh(motion, tmp_path / "b.bvh")
    again = read_bvh(tmp_path / "b.bvh", unit="cm", up="y", skip_first=False)
    assert again.skeleton.joints == motion.skeleton.joints
    np.testing.assert_allclose(again.positions, motion.positions, atol=1e-3)


@pytest.mark.real
def test_every_real_file_reads_in_metres_and_survives_writing(shared_data, tmp_path):
    files = sorted((shared_data / "bvh" / "motions").glob("*.bvh"))
    assert len(files) >= 80
    for i, file in enumerate(files):
        motion = read_bvh(file)
        roles = motion.skeleton.roles
        leg = motion.skeleton.bone_lengths[[roles["left_knee"], roles["left_ankle"]]].sum()
        assert 0.7 < leg < 1.0, file
        high = motion.positions[:, roles["head"], 1] - motion.positions[:, roles["left_ankle"], 1]
        assert np.percentile(high, 75) > 1.1, file
        feet = motion.positions[:, list(motion.skeleton.feet), 1].min(1)
        assert -0.1 < np.percentile(feet, 5) < 0.3 or file.name.startswith("cc_03"), file  # those are on a slope
        dropped = file.name.startswith("cmu") or file.name.startswith("daz_salsa")
        assert motion.frames == int(re.search(r"Frames:\s*(\d+)", file.read_text()).group(1)) - dropped
        if i % 4:
            continue
        write_bvh(motion, tmp_path / "again.bvh")
        again = read_bvh(tmp_path / "again.bvh", skip_first=False)
        assert again.skeleton.joints == motion.skeleton.joints
        assert again.fps == pytest.approx(motion.fps, rel=1e-5)
        np.testing.assert_allclose(again.positions, motion.positions, atol=1e-3)
        same = np.abs((again.rotations * motion.rotations).sum(-1))
        assert same.min() > 1 - 1e-5


@pytest.mark.real
@pytest.mark.parametrize(
    "name", ["cmu_49_08", "cc_02_04", "daz_train_data_bvh_standard", "bandai_dataset-2_walk_active_003"]
)
def test_positions_agree_with_bvhio(shared_data, name):
    import bvhio

    file = shared_data / "bvh" / "motions" / f"{name}.bvh"
    motion = read_bvh(file, skip_first=False)
    other = bvhio.readAsHierarchy(str(file))
    joints = {joint.Name: joint for joint, _, _ in other.layout()}
    scale = CMU if name.startswith("cmu") else 0.01
    index = [i for i, joint in enumerate(motion.skeleton.joints) if joint in joints]
    assert len(index) >= len(joints) - 1
    for frame in {0, motion.frames // 2, motion.frames - 1}:
        other.loadPose(frame)
        expected = np.array([list(joints[motion.skeleton.joints[i]].PositionWorld) for i in index]) * scale
        expected[:, 1] += 1.05214226 if name == "cc_02_04" else 0  # its root's positions are meant from the OFFSET
        np.testing.assert_allclose(motion.positions[frame, index], expected, atol=1e-3)


@pytest.mark.real
@pytest.mark.parametrize("name", ["cmu_08_02", "cc_02_01", "daz_salsa_10"])
def test_positions_agree_with_pybvh(shared_data, name):
    import pybvh

    file = shared_data / "bvh" / "motions" / f"{name}.bvh"
    motion = read_bvh(file, skip_first=False)
    other = pybvh.read_bvh_file(str(file))
    scale = CMU if name.startswith("cmu") else 0.01
    index = [i for i, joint in enumerate(motion.skeleton.joints) if joint in other.joint_names]
    columns = [list(other.joint_names).index(motion.skeleton.joints[i]) for i in index]
    np.testing.assert_allclose(motion.positions[:, index], other.joint_positions()[:, columns] * scale, atol=1e-3)


def person(height: float = 1.0, frames: int = 12) -> Motion:
    """A smpl22 figure that turns and bends, with true rotations."""
    from motionary.motion import forward_kinematics

    skeleton = Skeleton.named("smpl22")
    rng = np.random.default_rng(0)
    phase = np.linspace(0, 2, frames)[:, None]
    axis = rng.normal(size=(22, 3))
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    angle = 0.5 * np.sin(phase + rng.uniform(0, 6, 22))
    rotations = np.concatenate([axis * np.sin(angle / 2)[..., None], np.cos(angle / 2)[..., None]], -1)
    root = np.stack([phase[:, 0], np.full(frames, height), phase[:, 0] ** 2], -1)
    return Motion(forward_kinematics(skeleton, rotations, root), 20, skeleton, rotations)


def test_generated_motion_opens_in_another_reader(tmp_path):
    import bvhio

    motion = person()
    write_bvh(motion, tmp_path / "a.bvh")
    other = bvhio.readAsHierarchy(str(tmp_path / "a.bvh"))
    joints = {joint.Name: joint for joint, _, _ in other.layout()}
    for frame in (0, 7, 11):
        other.loadPose(frame)
        expected = np.array([list(joints[name].PositionWorld) for name in motion.skeleton.joints]) / 100
        np.testing.assert_allclose(motion.positions[frame], expected, atol=1e-3)


def test_positions_alone_get_rotations(tmp_path):
    motion = person()
    bare = Motion(motion.positions, motion.fps, motion.skeleton)
    write_bvh(bare, tmp_path / "a.bvh")
    again = read_bvh(tmp_path / "a.bvh")
    np.testing.assert_allclose(again.positions, motion.positions, atol=1e-3)
    assert (tmp_path / "a.bvh").read_text().count("position") == 3  # only the root moves: bones are constant


@pytest.mark.parametrize("unit", UNITS.values())
def test_unit_is_found(tmp_path, unit):
    motion = person()
    write_bvh(motion, tmp_path / "a.bvh", unit=unit)
    np.testing.assert_allclose(read_bvh(tmp_path / "a.bvh").positions, motion.positions, atol=2e-3)


def test_z_up_becomes_y_up(tmp_path):
    motion = person()
    swap = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], np.float32)  # y up -> z up
    skeleton = motion.skeleton.with_offsets(motion.skeleton.offsets @ swap.T)
    local = motion.rotations.copy()
    local[..., :3] = local[..., :3] @ swap.T
    write_bvh(Motion(motion.positions @ swap.T, 20, skeleton, local), tmp_path / "a.bvh")
    for up in (None, "z"):
        again = read_bvh(tmp_path / "a.bvh", up=up)
        np.testing.assert_allclose(again.positions, motion.positions, atol=1e-3)
        np.testing.assert_allclose(again.skeleton.offsets[1:], motion.skeleton.offsets[1:], atol=1e-4)
    raw = read_bvh(tmp_path / "a.bvh", up="y").positions
    np.testing.assert_allclose(raw, motion.positions @ swap.T, atol=1e-3)


@pytest.mark.parametrize("posture", ["stands", "sits on the floor", "lies on the back"])
@pytest.mark.parametrize("up", ["y", "z"])
def test_a_root_whose_positions_are_meant_from_its_offset(tmp_path, posture, up):
    """What only with its OFFSET is on the ground is added to it; what is elsewhere either way is said."""
    world, root = postures.person(posture)
    height = postures.person("stands")[1][0, 1]
    offset = " ".join(f"{x:.6f}" for x in quat_action(np.array(ONTO[up]), np.array([0, 100 * height, 0])))
    for less, said, sunk in ((0, "", 0), (height, "added to it", 0), (2 * height, "without it", 2 * height)):
        text = postures.written(world, root - [0, less, 0], up, "t")
        (tmp_path / "a.bvh").write_text(re.sub(r"OFFSET \S+ \S+ \S+", f"OFFSET {offset}", text, count=1))
        motion, reading = bvh_with(tmp_path / "a.bvh", ReadingOptions(up=up, unit="cm", mirror=False))
        assert [said in note for note in reading.notes] == ([True] if said else [])
        np.testing.assert_allclose(motion.positions[:, 0, 1], root[:, 1] - sunk, atol=1e-3)


def test_lying_person_stays_lying(tmp_path):
    motion = person()
    turn_x = np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    from motionary.motion import forward_kinematics
    from motionary.motion.rotations import quat_product

    local = motion.rotations.astype(float)
    local[:, 0] = quat_product(np.broadcast_to(turn_x, local[:, 0].shape), local[:, 0])
    flat = Motion(forward_kinematics(motion.skeleton, local, motion.positions[:, 0]), 20, motion.skeleton, local)
    write_bvh(flat, tmp_path / "a.bvh")
    np.testing.assert_allclose(read_bvh(tmp_path / "a.bvh").positions, flat.positions, atol=1e-3)


SMALL = """HIERARCHY
ROOT hip
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT knee { OFFSET 0 -40 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site { OFFSET 0 -45 0 } }
}
MOTION
Frames: 2
Frame Time: 0.04
0 90 0 0 0 0 0 0 0
0 90 5 0 0 0 0 90 0
"""


def test_end_sites_with_a_length_are_joints(tmp_path):
    path = tmp_path / "a.bvh"
    path.write_bytes(SMALL.replace("\n", "\r\n").encode("utf-8-sig"))
    motion = read_bvh(path, unit="cm")
    assert motion.skeleton.joints == ("hip", "knee", "knee_end")
    assert motion.fps == 25
    np.testing.assert_allclose(motion.positions[1], [[0, 0.9, 0.05], [0, 0.5, 0.05], [0, 0.5, -0.4]], atol=1e-6)


BROKEN = {
    "not a bvh": ("HIERARCHY", "HELLO", "line 1"),
    "no motion": ("MOTION\n", "", "MOTION"),
    "cut in the hierarchy": (SMALL[SMALL.index("End Site") :], "", "before its MOTION"),
    "open brace": ("}\nMOTION", "MOTION", "before the hierarchy is closed"),
    "brace too many": ("}\nMOTION", "}\n}\nMOTION", "never opened"),
    "offset word": ("OFFSET 0 -40 0", "OFFSET 0 x 0", "line 6"),
    "offset of two": ("OFFSET 0 -40 0", "OFFSET 0 -40", "line 6"),
    "offset nan": ("OFFSET 0 -40 0", "OFFSET 0 nan 0", "finite"),
    "channel name": ("CHANNELS 3 Zrotation", "CHANNELS 3 Wrotation", "line 7"),
    "channel count": ("CHANNELS 3", "CHANNELS 2", "line 7"),
    "channel twice": ("CHANNELS 3 Zrotation Xrotation", "CHANNELS 3 Zrotation Zrotation", "different"),
    "frames word": ("Frames: 2", "Frames: two", "line 11"),
    "no frames": ("Frames: 2", "Frames: 0", "above 0"),
    "frame time": ("Frame Time: 0.04", "Frame Time: 0", "above 0"),
    "frame time gone": ("Frame Time: 0.04\n", "", "Frame Time"),
    "fewer frames": ("Frames: 2", "Frames: 3", "truncated"),
    "short row": ("0 90 5 0 0 0 0 90 0", "0 90 5 0", "line 14"),
    "cut in a number row": ("5 0 0 0 0 90 0\n", "5 0 0 0 0", "frame 2 must hold 9"),
    "not a number": ("0 90 5", "0 9o 5", "line 14"),
    "nan": ("0 90 5", "0 nan 5", "frame 2 must be finite"),
    "infinity": ("0 90 5", "0 inf 5", "frame 2 must be finite"),
    "child of an end site": ("End Site { OFFSET", "End Site { JOINT x { OFFSET 0 0 0 } OFFSET", "no children"),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_broken_files_name_file_line_and_rule(tmp_path, kind):
    old, new, expected = BROKEN[kind]
    assert old in SMALL
    path = tmp_path / "broken.bvh"
    path.write_text(SMALL.replace(old, new, 1))
    with pytest.raises(InputError, match=r"broken\.bvh") as caught:
        read_bvh(path)
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_more_frames_than_said_are_read_and_said(tmp_path):
    path = tmp_path / "a.bvh"
    path.write_text(SMALL.replace("Frames: 2", "Frames: 1"))
    motion, reading = bvh_with(path, ReadingOptions(unit="cm"))
    assert motion.frames == 2
    assert any("says 1, the file holds 2" in note for note in reading.notes)
    path.write_text(SMALL.replace("Frames: 2", "Frames: 1") + "1 2 3\n")
    with pytest.raises(InputError, match="frame 3 must hold 9"):
        read_bvh(path)


def test_a_hole_of_gigabytes_after_the_text_is_refused_at_once(tmp_path):
    path = tmp_path / "hole.bvh"
    path.write_bytes(SMALL.encode() + b"\0" * 5000)
    assert read_bvh(path).frames == 2
    os.truncate(path, 1 << 40)
    with pytest.raises(InputError, match="filling"):
        read_bvh(path)


def test_bytes_that_are_no_text(tmp_path):
    path = tmp_path / "broken.bvh"
    path.write_bytes(bytes(range(256)) * 4)
    with pytest.raises(InputError, match="HIERARCHY"):
        read_bvh(path)


def test_options_are_checked(tmp_path):
    path = tmp_path / "a.bvh"
    path.write_text(SMALL)
    for options in ({"unit": "mile"}, {"unit": -1.0}, {"up": "w"}, {"fps": -5.0}):
        with pytest.raises(InputError):
            read_bvh(path, **options)
    with pytest.raises(InputError, match="unit"):
        write_bvh(read_bvh(path), tmp_path / "b.bvh", unit=0)


@pytest.mark.parametrize("more", [1, 4, 30])
def test_rows_beyond_the_frames_that_are_told_are_read(tmp_path, more):
    text, positions = random_bvh(np.random.default_rng(3))
    (tmp_path / "more.bvh").write_text(text + (text.splitlines()[-1] + "\n") * more)
    found, reading = bvh_with(tmp_path / "more.bvh", ReadingOptions(up="y", unit=1.0, mirror=False, skip_first=False))
    assert found.frames == len(positions) + more
    np.testing.assert_allclose(found.positions[-more:], np.repeat(found.positions[[len(positions) - 1]], more, 0))
    assert any("all of them were read" in note for note in reading.notes)
