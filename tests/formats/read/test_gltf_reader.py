"""glTF read: our own files back, other programs' rigs, every kind of keys, and each kind of damage in one line."""

from __future__ import annotations

import copy
import os
import tracemalloc

import numpy as np
import pytest
from gltf_made import Made, character

from motionary.cli import main
from motionary.errors import InputError, InputWarning
from motionary.formats import read_motion, write_motion
from motionary.formats.gltf_container import packed
from motionary.formats.gltf_file import GltfFile
from motionary.formats.read import read_motion_with
from motionary.motion import Motion, Skeleton
from motionary.motion.rotations import quat_action, rotvec_to_unitquat

TURN = rotvec_to_unitquat(np.array([[0, 0, 0], [0, 0, np.pi / 2]]))


def same(found: Motion, expected: Motion, near: float = 1e-5) -> None:
    """Names, rate, places and rotations."""
    assert (found.skeleton.joints, found.fps) == (expected.skeleton.joints, pytest.approx(expected.fps, rel=1e-6))
    np.testing.assert_allclose(found.positions, expected.positions, atol=near)
    np.testing.assert_allclose(np.abs((found.rotations * expected.rotations).sum(-1)), 1, atol=near)
    np.testing.assert_allclose(found.skeleton.offsets[1:], expected.skeleton.offsets[1:], atol=near)


@pytest.mark.parametrize("mesh", [True, False])
@pytest.mark.parametrize("name", ["smpl22", "kit21", "chain"])
@pytest.mark.parametrize("fps", [20.0, 29.97])
def test_our_own_files_read_back(tmp_path, make_walker, name, mesh, fps):
    skeleton = (
        Skeleton.from_rig("chain", [f"b{i}" for i in range(5)], [-1, 0, 1, 1, 0], 0.3 * np.eye(5, 3) + 0.1)
        if name == "chain"
        else Skeleton.named(name)
    )
    motion = make_walker(skeleton, fps=fps)
    write_motion(motion, tmp_path / "a.glb", mesh=mesh)
    again = read_motion(tmp_path / "a.glb")
    same(again, motion)
    if name != "chain":
        assert again.skeleton == motion.skeleton


def test_joints_that_leave_their_bones_and_first_frames_that_are_poses_stay(tmp_path, person):
    moved = person.positions.copy()
    moved[:, 15:] += 0.1 * np.sin(np.arange(20))[:, None, None]
    moved[0] = Skeleton.named("smpl22").rest + np.array([0, 1, 0])
    motion = Motion(moved, 20, person.skeleton, person.rotations)
    again = read_motion(write_motion(motion, tmp_path / "a.glb"))
    np.testing.assert_allclose(again.positions, moved, atol=6e-4)


@pytest.mark.real
@pytest.mark.parametrize("name", ["cc_02_01", "daz_salsa_10", "bandai_dataset-2_walk_active_003"])
def test_real_rigs_read_back(shared_data, tmp_path, name):
    motion = read_motion(shared_data / "bvh" / "motions" / f"{name}.bvh").crop(0, 40)
    again = read_motion(write_motion(motion, tmp_path / "a.glb"))
    same(again, motion, 6e-4)


@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.parametrize("posed", [False, True])
def test_a_rig_with_axes_of_its_own_is_read_in_the_world_s(tmp_path, person, posed, inside):
    """Bones turned any way, centimetres, z up, an armature above: places, and rotations from the bind, are the same."""
    motion, reading = read_motion_with(character(person, posed=posed, inside=inside).glb(tmp_path / "a.glb"))
    same(motion, person)
    assert (reading.up, reading.unit, reading.mirrored) == ("y", 1.0, False)


def test_known_names_give_roles_and_retargeting_is_that_of_bvh(tmp_path, person):
    from motionary.motion import retarget

    path = character(person, prefix="mixamorig:").glb(tmp_path / "a.glb")
    motion = read_motion(path)
    assert motion.skeleton.roles["left_wrist"] == person.skeleton.roles["left_wrist"]
    kit = Skeleton.named("kit21")
    write_motion(person, tmp_path / "a.bvh")
    expected = retarget(read_motion(tmp_path / "a.bvh"), kit).positions
    np.testing.assert_allclose(retarget(motion, kit).positions, expected, atol=2e-3)


def test_a_motion_on_a_character_s_file_reads_back(tmp_path, person):
    path = character(person, posed=True).glb(tmp_path / "character.glb")
    write_motion(person, tmp_path / "a.glb", onto=path)
    moved = person.to(path)
    again = read_motion(tmp_path / "a.glb")
    np.testing.assert_allclose(again.positions, moved.positions, atol=1e-4)


@pytest.mark.parametrize("beside", [None, "buffers/one two.bin"])
def test_text_with_its_buffer_inside_or_beside_it(tmp_path, person, beside):
    (tmp_path / "buffers").mkdir()
    path = character(person).gltf(tmp_path / "a.gltf", beside)
    if beside:
        path.write_text(path.read_text().replace("one two", "one%20two"))
    same(read_motion(path), person)


def two_nodes() -> Made:
    return Made([{"name": "a", "children": [1]}, {"name": "b", "translation": [1.0, 0, 0]}])


def places(made: Made, tmp_path, **options) -> np.ndarray:
    """(T, 2, 3) of the two nodes."""
    return read_motion(made.glb(tmp_path / "a.glb"), up="y", unit=1.0, mirror=False, **options).positions


def test_linear_keys_go_straight_and_turns_the_short_way(tmp_path):
    made = two_nodes()
    made.channel(0, "translation", [0, 1], [[0, 0, 0], [0, 2, 0]])
    made.channel(0, "rotation", [0, 1], TURN * [[1], [-1]])
    found = places(made, tmp_path, fps=4)
    np.testing.assert_allclose(found[:, 0, 1], [0, 0.5, 1, 1.5, 2], atol=1e-6)
    angles = np.radians([0, 22.5, 45, 67.5, 90])
    np.testing.assert_allclose(found[:, 1, 0], np.cos(angles), atol=1e-6)


def test_steps_hold_and_what_ends_early_stays(tmp_path):
    made = two_nodes()
    made.channel(0, "translation", [0, 0.5, 1], [[0, 0, 0], [1, 0, 0], [2, 0, 0]], "STEP")
    made.channel(0, "rotation", [0.25, 0.5], TURN)
    found = places(made, tmp_path, fps=4)
    np.testing.assert_allclose(found[:, 0, 0], [0, 0, 1, 1, 2], atol=1e-6)
    np.testing.assert_allclose(found[:, 1, 1], [0, 0, 1, 1, 1], atol=1e-6)


def test_cubic_keys_follow_their_tangents(tmp_path):
    """A cubic polynomial is its own Hermite spline: x(t) = t^3 - t, over a key in between."""
    made = two_nodes()
    t = np.array([0, 0.5, 2])
    keys = np.zeros((3, 3, 3))
    keys[:, 0, 0] = keys[:, 2, 0] = 3 * t**2 - 1
    keys[:, 1, 0] = t**3 - t
    made.channel(0, "translation", t, keys.reshape(9, 3), "CUBICSPLINE")
    turns = np.zeros((2, 3, 4))
    turns[:, 1] = TURN
    made.channel(0, "rotation", [0, 2], turns.reshape(6, 4), "CUBICSPLINE")
    found = places(made, tmp_path, fps=8)
    time = np.arange(17) / 8
    np.testing.assert_allclose(found[:, 0, 0], time**3 - time, atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(found[:, 1] - found[:, 0], axis=-1), 1, atol=1e-6)
    np.testing.assert_allclose((found[8, 1] - found[8, 0])[:2], [np.sqrt(0.5)] * 2, atol=1e-5)


def test_rotations_of_whole_numbers(tmp_path):
    for dtype, near in (("i2", 1e-4), ("i1", 2e-2)):
        made = two_nodes()
        values = np.round(TURN * np.iinfo(dtype).max)
        made.channel(0, "rotation", [0, 1], values, dtype=dtype, normalized=True)
        np.testing.assert_allclose(places(made, tmp_path, fps=1)[1, 1], [0, 1, 0], atol=near)


@pytest.mark.parametrize(
    ("times", "rate"),
    [
        (np.arange(50) / 24, 24),
        (np.arange(50) / 29.97, 29.97),
        (1 / 24 + np.arange(3000) / 60, 60),
        (np.array([0, 1, 2, 5, 6, 11, 12, 20]) / 30, 30),  # keys that say nothing new were left out
        ([0, 0.5, 2.0], 30),  # set by hand
        ([0.0], 30),
        (np.array([0, 0.111, 0.253, 0.299, 0.402]), 30),
    ],
)
def test_the_rate_is_that_of_the_keys(tmp_path, times, rate):
    made = two_nodes()
    made.channel(0, "translation", times, np.arange(3 * len(times)).reshape(-1, 3))
    motion = read_motion(made.glb(tmp_path / "a.glb"), up="y", mirror=False)
    assert motion.fps == pytest.approx(rate, rel=1e-5)
    length = times[-1] - times[0]
    assert length - 1 / rate < (motion.frames - 1) / motion.fps <= length + 0.1 / rate
    np.testing.assert_allclose(motion.positions[0, 0], [0, 1, 2], atol=1e-5)


def test_bones_without_a_skin_are_what_hangs_on_the_nodes_that_move(tmp_path):
    nodes = [{"name": "scene", "children": [1, 4]}, {"name": "hip", "children": [2]}, {"name": "knee", "children": [3]}]
    made = Made([*nodes, {"name": "ankle"}, {"name": "lamp", "translation": [5, 0, 0]}])
    made.channel(1, "rotation", [0, 1], TURN)
    assert read_motion(made.glb(tmp_path / "a.glb"), up="y", mirror=False).skeleton.joints == ("hip", "knee", "ankle")


def test_an_animation_is_chosen_by_name(tmp_path, capsys):
    made = two_nodes()
    for name, far in (("stand", 0), ("run", 3)):
        made.animation(name)
        made.channel(0, "translation", [0, 1], [[0, 0, 0], [far, 0, 0]])
        made.channel(0, "rotation", [0, 1], TURN)
    path = made.glb(tmp_path / "a.glb")
    with pytest.warns(InputWarning, match=r"holds 2 animations, stand, run; took stand .*--animation"):
        assert read_motion(path, up="y", mirror=False).positions[-1, 0, 0] == 0
    read, options = read_motion(path, up="y", mirror=False, animation="run"), ["--up", "y", "--no-mirror"]
    assert read.positions[-1, 0, 0] == 3
    assert main(["convert", str(path), str(tmp_path / "b.npz"), "--animation", "run", *options]) == 0
    np.testing.assert_array_equal(read_motion(tmp_path / "b.npz").positions, read.positions)
    assert main(["convert", str(path), str(tmp_path / "c.npz"), "--animation", "jump", *options]) == 2
    assert "a.glb, animation: jump: must be one of stand, run" in capsys.readouterr().err
    write_motion(read, tmp_path / "d.bvh")
    assert main(["inspect", str(tmp_path / "d.bvh"), "--animation", "run"]) == 2


def test_scales_shorten_bones_and_odd_ones_are_said(tmp_path):
    nodes = [{"name": "a", "children": [1], "scale": [2, 2, 2]}, {"name": "b", "translation": [1, 0, 0]}]
    nodes[1] |= {"children": [2], "scale": [0.5, 0.5, 0.5]}
    made = Made([*nodes, {"name": "c", "translation": [0, 1, 0]}])
    made.channel(0, "rotation", [0, 1], TURN)
    found = read_motion(made.glb(tmp_path / "a.glb"), up="y", mirror=False).positions
    np.testing.assert_allclose(found[0], [[0, 0, 0], [2, 0, 0], [2, 1, 0]], atol=1e-6)
    made.document["nodes"][1]["scale"] = [0.5, 1, 1]
    with pytest.warns(InputWarning, match="scales that change or differ by axis .*: b"):
        read_motion(made.glb(tmp_path / "a.glb"))
    made.document["nodes"][1]["scale"] = [0.5, -1, 1]
    with pytest.raises(InputError, match=r"a\.glb, node 1, scale"):
        read_motion(made.glb(tmp_path / "a.glb"))


def test_matrices_are_taken_apart(tmp_path):
    made = two_nodes()
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]) * 2
    matrix[:3, 3] = [0, 3, 0]
    made.document["nodes"].append({"children": [0], "matrix": matrix.T.reshape(-1).tolist()})
    made.channel(0, "rotation", [0, 1], TURN)
    np.testing.assert_allclose(places(made, tmp_path)[0], [[0, 3, 0], [0, 5, 0]], atol=1e-6)


def test_of_a_buffer_beside_no_more_is_read_than_it_is_said_to_hold(tmp_path, make_walker):
    path = character(make_walker()).gltf(tmp_path / "a.gltf", "a.bin")
    whole = read_motion(path)
    os.truncate(tmp_path / "a.bin", 1 << 40)  # no machine could read it all
    np.testing.assert_array_equal(read_motion(path).positions, whole.positions)


BROKEN = {
    "version": (lambda d: d["asset"].update(version="1.0"), "version 1.0"),
    "no asset": (lambda d: d.pop("asset"), "version None"),
    "no animation": (lambda d: d.update(animations=[]), "animations"),
    "animations of another kind": (lambda d: d.update(animations="x"), "animations.*list of objects"),
    "nothing that moves": (lambda d: d["animations"][0].update(channels=[]), "animations.*one must move joints"),
    "node beyond": (lambda d: d["nodes"][0].update(children=[99]), "node 0, children.*below 23"),
    "two parents": (lambda d: d["nodes"][5].update(children=[1]), "no node has two parents"),
    "a circle": (lambda d: (d["nodes"].append({"children": [24]}), d["nodes"].append({"children": [23]})), "circle"),
    "child of itself": (lambda d: d["nodes"][22].update(children=[0, 22]), "no node has two parents"),
    "rotation of three": (lambda d: d["nodes"][3].update(rotation=[0, 0, 1]), "node 3, rotation.*4 finite numbers"),
    "rotation of nothing": (lambda d: d["nodes"][3].update(rotation=[0, 0, 0, 0]), "node 3, rotation.*unit quatern"),
    "nan": (lambda d: d["nodes"][3].update(translation=[0, float("nan"), 0]), "node 3, translation.*finite"),
    "joints": (lambda d: d["skins"][0].update(joints=[0, True]), "skin 0, joints"),
    "sampler": (lambda d: d["animations"][0]["channels"][2].update(sampler=-1), "channel 2, sampler"),
    "twice": (lambda d: d["animations"][0]["channels"].append(d["animations"][0]["channels"][0]), "one channel"),
    "interpolation": (lambda d: d["animations"][0]["samplers"][2].update(interpolation="SLERP"), "SLERP"),
    "too few values": (lambda d: d["accessors"][0].update(count=19), "channel 0, output.*19 values.*20 keys"),
    "too many values": (lambda d: d["accessors"][0].update(count=10**11), "channel 0, output.*within its buffer"),
    "component": (lambda d: d["accessors"][0].update(componentType=7), "channel 0, output"),
    "type": (lambda d: d["accessors"][0].update(type="VEC4"), "channel 0, output"),
    "sparse": (lambda d: d["accessors"][0].update(sparse={}), "channel 0, output.*sparse"),
    "view": (lambda d: d["accessors"][0].update(bufferView="x"), "channel 0, output, bufferView"),
    "offset": (lambda d: d["bufferViews"][0].update(byteOffset=10**9), "channel 0, output.*within its buffer"),
    "stride": (lambda d: d["bufferViews"][0].update(byteStride=4), "channel 0, output.*within its buffer"),
    "packed": (lambda d: d["bufferViews"][0].update(extensions={"EXT_meshopt_compression": {}}), "meshopt.*unpack"),
    "buffer": (lambda d: d["bufferViews"][0].update(buffer=1), "channel 0, output, buffer"),
    "away": (lambda d: d["buffers"][0].update(uri="../a.bin"), "buffer 0, uri.*in the folder"),
    "long": (lambda d: d["buffers"][0].update(uri="a" * 5000), "buffer 0, uri.*in the folder"),
    "web": (lambda d: d["buffers"][0].update(uri="https://x.org/a.bin"), "buffer 0, uri.*in the folder"),
    "base64": (lambda d: d["buffers"][0].update(uri="data:;base64,???"), "buffer 0, uri.*base64"),
}


@pytest.fixture
def good(make_walker) -> Made:
    made = character(make_walker())
    made.document["buffers"] = [{"byteLength": len(made.data)}]
    return made


@pytest.mark.parametrize("kind", BROKEN)
def test_broken_files_name_file_part_and_rule(tmp_path, good, kind):
    change, rule = BROKEN[kind]
    document = copy.deepcopy(good.document)
    change(document)
    (tmp_path / "broken.glb").write_bytes(packed(document, bytes(good.data)))
    with pytest.raises(InputError, match=rf"broken\.glb.*{rule}") as caught:
        read_motion(tmp_path / "broken.glb")
    assert "\n" not in str(caught.value)


def test_other_bytes_and_keys_far_away(tmp_path, person):
    (tmp_path / "a.glb").write_bytes(b"glTF")
    (tmp_path / "b.gltf").write_text("{")
    (tmp_path / "c.gltf").write_text("[" * 100_000)
    (tmp_path / "d.gltf").write_text("[]")
    for name in ("a.glb", "b.gltf", "c.gltf", "d.gltf"):
        with pytest.raises(InputError, match=f"{name}: .*must be a glTF 2.0"):
            read_motion(tmp_path / name)
    for times, rule in (([0, 1e30], "cut it into parts"), ([1, 0], "that rise"), ([0, np.inf], "finite")):
        made = two_nodes()
        made.channel(0, "translation", times, np.zeros((2, 3)))
        with pytest.raises(InputError, match=rf"a\.glb.*{rule}"):
            read_motion(made.glb(tmp_path / "a.glb"))


def test_a_glb_ends_where_its_head_says(tmp_path, good):
    """What follows is none of it, and a hole of zeros is not taken for chunks."""
    whole = packed(good.document, bytes(good.data))
    (tmp_path / "whole.glb").write_bytes(whole)
    (tmp_path / "more.glb").write_bytes(whole + bytes(1000))
    assert read_motion(tmp_path / "more.glb").frames == read_motion(tmp_path / "whole.glb").frames
    for name, data, rule in (
        ("cut", whole[:-4], "truncated"),
        ("empty", b"glTF\2\0\0\0" + bytes(4096), "no JSON"),
        ("chunks", b"glTF\2\0\0\0" + (12 + 8 * 400).to_bytes(4, "little") + bytes(3200), "more than 16 chunks"),
    ):
        (tmp_path / f"{name}.glb").write_bytes(data)
        with pytest.raises(InputError, match=rf"{name}\.glb: {rule}"):
            read_motion(tmp_path / f"{name}.glb")


@pytest.mark.parametrize(
    ("head", "rule"),
    [
        (b"glTF\2\0\0\0\0\0\0\x40", "more than 16 chunks"),
        (b"glTF\2\0\0\0\0\0\0\x40\xec\xff\xff\x3fJSON", "bytes of JSON.*must be at most"),
        (b"glTF\2\0\0\0\1\0\0\x40", "truncated"),
        (b"{", "bytes of JSON.*must be at most"),
    ],
)
def test_a_hole_of_a_gigabyte_is_not_read(tmp_path, head, rule):
    path = tmp_path / "hole.glb"
    with path.open("wb") as file:
        file.write(head)
        file.truncate(1 << 30)
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=rf"hole\.glb: .*{rule}"):
            read_motion(path)
        assert tracemalloc.get_traced_memory()[1] < 1 << 24
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("twins", [False, True])
def test_keys_that_many_joints_share_take_memory_once(tmp_path, twins):
    """Whether the joints name one accessor, or accessors that lie on the same bytes."""
    keys, made = 20_000, Made([{"children": [i + 1]} for i in range(399)] + [{}])
    turns = np.tile([0.0, 0, 0, 1], (keys, 1))
    made.channel(0, "rotation", np.arange(keys) / 30, turns)
    take, accessors = made.document["animations"][0], made.document["accessors"]
    for node in range(1, 400):
        output = len(accessors) if twins else take["samplers"][0]["output"]
        accessors += [accessors[take["samplers"][0]["output"]]] if twins else []
        take["samplers"].append(take["samplers"][0] | {"output": output})
        take["channels"].append({"sampler": node, "target": {"node": node, "path": "rotation"}})
    path = made.glb(tmp_path / "a.glb")
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=r"a\.glb: .*1,0.*keys.*may have 1,000,000" if twins else "400 joints"):
            read_motion(path)
        assert tracemalloc.get_traced_memory()[1] < 64e6
    finally:
        tracemalloc.stop()


def test_a_link_out_of_the_folder_is_not_followed(tmp_path, person):
    (tmp_path / "in").mkdir()
    made = character(person)
    path = made.gltf(tmp_path / "in" / "a.gltf", "a.bin")
    (tmp_path / "in" / "a.bin").rename(tmp_path / "a.bin")
    (tmp_path / "in" / "a.bin").symlink_to(tmp_path / "a.bin")
    with pytest.raises(InputError, match="in the folder"):
        read_motion(path)


def test_a_folder_of_them_is_a_data_root(tmp_path, make_walker):
    from motionary.corpus.preprocess import preprocess

    root = tmp_path / "root"
    root.mkdir()
    write_motion(make_walker(frames=60), root / "a.glb")
    character(make_walker(frames=60)).gltf(root / "b.gltf")
    settings = {"source": "folder", "roots": [str(root)], "workers": 1, "mirror": False, "split": "clip"}
    report = preprocess({**settings, "ratios": [1.0, 0.0, 0.0]}, tmp_path / "corpus", progress=False)
    assert (report["read"], report["kept"]) == (2, 2)


def test_help_names_the_formats(capsys):
    for verb in ("inspect", "convert", "caption"):
        with pytest.raises(SystemExit):
            main([verb, "--help"])
        assert "glb" in capsys.readouterr().out


def test_chunks_of_our_own_file(tmp_path, person):
    """The container is what `packed` made: JSON, and as many bytes as its buffer says."""
    file = GltfFile.read(write_motion(person, tmp_path / "a.glb"))
    document, data = file.document, file.data
    assert len(data) == document["buffers"][0]["byteLength"]
    np.testing.assert_allclose(quat_action(TURN[1], np.array([1.0, 0, 0])), [0, 1, 0], atol=1e-12)
