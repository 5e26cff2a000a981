"""Files written onto a character's own: what it holds stays, what moves is the motion, and other readers open it."""

from __future__ import annotations

import io
import json

import bvhio
import numpy as np
import pygltflib
import pytest

from motionary.errors import InputError
from motionary.formats import read_motion, write_motion
from motionary.formats.bvh_text import parse
from motionary.formats.gltf_container import packed
from motionary.formats.gltf_file import GltfFile
from motionary.formats.read.smpl import SMPL_OFFSETS, SMPL_ROOT
from motionary.formats.write.glb_rig import Character
from motionary.motion import Motion, Skeleton
from motionary.motion.rigging import to_rig
from motionary.motion.rotations import unitquat_to_rotmat

# Arms 45 degrees down, channels in the order x y z, a jaw and thumbs; in decimetres, and in centimetres in the file.
CHARACTER = {
    "Hips": (None, (0, 9.5, 0)),
    "Spine": ("Hips", (0, 1.2, 0)), "Spine1": ("Spine", (0, 1.4, 0)), "Spine2": ("Spine1", (0, 1.1, 0)),
    "Neck": ("Spine2", (0, 1.9, 0)), "Head": ("Neck", (0, 1.1, 0.2)), "Jaw": ("Head", (0, 0.1, 0.6)),
    **{k.replace("S", s): ((p or "").replace("S", s), (sign * x, y, z)) for s, sign in (("Left", 1), ("Right", -1))
       for k, (p, (x, y, z)) in {
        "SUpLeg": ("Hips", (0.9, -0.6, 0)), "SLeg": ("SUpLeg", (0.1, -4.3, 0)), "SFoot": ("SLeg", (0, -4.1, -0.2)),
        "SToeBase": ("SFoot", (0, -0.6, 1.4)), "SShoulder": ("Chest", (0.5, 1.5, 0)),
        "SArm": ("SShoulder", (1.2, 0, 0)), "SForeArm": ("SArm", (1.9, -1.9, 0)),
        "SHand": ("SForeArm", (1.8, -1.8, 0)), "SThumb": ("SHand", (0.2, -0.2, 0.3)),
    }.items()},
}  # fmt: skip


@pytest.fixture
def character(tmp_path):
    """A BVH file of one frame at rest; (path, its text up to MOTION)."""
    rows = {name: ("Spine2" if parent == "Chest" else parent, offset) for name, (parent, offset) in CHARACTER.items()}

    def node(name: str, depth: int) -> list[str]:
        """Lines of one joint and what hangs on it."""
        pad, kind = "\t" * depth, "ROOT" if depth == 0 else "JOINT"
        channels = "6 Xposition Yposition Zposition " if depth == 0 else "3 "
        lines = [
            f"{pad}{kind} {name}",
            f"{pad}{{",
            f"{pad}\tOFFSET " + " ".join(f"{10 * x:.6f}" for x in rows[name][1]),
        ]
        lines.append(f"{pad}\tCHANNELS {channels}Xrotation Yrotation Zrotation")
        below = [child for child, (parent, _) in rows.items() if parent == name]
        for child in below:
            lines += node(child, depth + 1)
        if not below:
            lines += [f"{pad}\tEnd Site", f"{pad}\t{{", f"{pad}\t\tOFFSET 0.000000 1.000000 0.000000", f"{pad}\t}}"]
        return [*lines, f"{pad}}}"]

    head = "\n".join(["HIERARCHY", *node("Hips", 0)]) + "\n"
    values = " ".join(["0 95 0"] + ["0"] * 3 * len(rows))
    path = tmp_path / "character.bvh"
    path.write_text(f"{head}MOTION\nFrames: 1\nFrame Time: 0.04\n{values}\n")
    return path, head


def test_a_bvh_keeps_its_hierarchy_to_the_letter(person, character, tmp_path):
    path, head = character
    write_motion(person, tmp_path / "out.bvh", onto=path)
    assert (tmp_path / "out.bvh").read_text().startswith(head)


def test_a_second_reader_finds_the_joints_where_they_were_put(person, character, tmp_path):
    path, _ = character
    moved = person.to(path)
    write_motion(person, tmp_path / "out.bvh", onto=path)
    again = read_motion(tmp_path / "out.bvh", unit=0.01)
    np.testing.assert_allclose(again.positions, moved.positions, atol=1e-5)
    assert again.fps == person.fps
    root = bvhio.readAsHierarchy(str(tmp_path / "out.bvh"))
    for frame in (0, 11):
        root.loadPose(frame)
        for joint, _, _ in root.layout():
            found = 0.01 * np.array(joint.PositionWorld.to_tuple())
            if (name := joint.Name) in moved.skeleton.joints:
                at = moved.skeleton.joints.index(name)
                np.testing.assert_allclose(found, moved.positions[frame, at], atol=1e-4)


@pytest.mark.real
@pytest.mark.parametrize("name", ["cc_02_01", "cmu_08_02", "daz_salsa_10", "bandai_dataset-2_walk_active_003"])
def test_real_rigs_keep_their_hierarchy(shared_data, person, tmp_path, name):
    path = shared_data / "bvh" / "motions" / f"{name}.bvh"
    write_motion(person, tmp_path / "out.bvh", onto=path)
    ours, theirs = (parse(io.BytesIO(p.read_bytes()), p) for p in (tmp_path / "out.bvh", path))
    assert [(n.name, n.parent, n.channels) for n in ours.nodes] == [
        (n.name, n.parent, n.channels) for n in theirs.nodes
    ]
    np.testing.assert_allclose([n.offset for n in ours.nodes], [n.offset for n in theirs.nodes], atol=1e-6)
    moved = person.to(path)
    again = read_motion(tmp_path / "out.bvh", skip_first=False)
    np.testing.assert_allclose(again.positions, moved.positions, atol=2e-3)
    root = bvhio.readAsHierarchy(str(tmp_path / "out.bvh"))
    root.loadPose(5)
    ankle = again.skeleton.feet[0]
    knee = again.skeleton.parents[ankle]
    at = {joint.Name: np.array(joint.PositionWorld.to_tuple()) for joint, _, _ in root.layout()}
    found = at[again.skeleton.joints[ankle]] - at[again.skeleton.joints[knee]]
    bone = again.positions[5, ankle] - again.positions[5, knee]
    assert bone @ found > 0.9999 * np.linalg.norm(bone) * np.linalg.norm(found)


@pytest.fixture
def skinned(tmp_path):
    """A .glb in centimetres under a turned armature, A-posed by its nodes' rotations, with a mesh and an animation."""
    smpl = Skeleton.named("smpl22")
    Motion(np.tile(smpl.rest + np.array([0, 1, 0]), (2, 1, 1)), 30, smpl).save(tmp_path / "plain.glb")
    plain = Character.read(tmp_path / "plain.glb")
    document = json.loads(json.dumps(plain.file.document))
    for node in document["nodes"][:22]:
        node["translation"] = [100 * x for x in node["translation"]]
    half = np.radians(45) / 2
    for name, sign in (("left_shoulder", -1), ("right_shoulder", 1)):
        document["nodes"][smpl.joints.index(name)]["rotation"] = [0, 0, sign * np.sin(half), np.cos(half)]
    turn = np.sqrt(0.5)
    armature = {"name": "Armature", "children": [0], "rotation": [turn, 0, 0, turn], "scale": [0.01] * 3}
    document["nodes"][0] |= {"rotation": [-turn, 0, 0, turn], "translation": [0, 0, -100]}
    document["nodes"].append(armature)
    document["scenes"] = [{"nodes": [len(document["nodes"]) - 1, 22]}]
    path = tmp_path / "skinned.glb"
    path.write_bytes(packed(document, plain.file.data))
    return path


def worlds(document: pygltflib.GLTF2, frame: int) -> dict[str, np.ndarray]:
    """Global positions by node name at a frame, from the parsed file alone."""
    blob, (animation,) = document.binary_blob(), document.animations
    local = {}
    for i, node in enumerate(document.nodes):
        local[i] = [node.translation or [0, 0, 0], node.rotation or [0, 0, 0, 1], node.scale or [1, 1, 1]]
    for channel in animation.channels:
        accessor = document.accessors[animation.samplers[channel.sampler].output]
        view = document.bufferViews[accessor.bufferView]
        values = np.frombuffer(blob, np.float32, view.byteLength // 4, view.byteOffset).reshape(accessor.count, -1)
        local[channel.target.node][{"translation": 0, "rotation": 1}[channel.target.path]] = values[frame]
    found = {}

    def visit(i: int, above: np.ndarray) -> None:
        """Places node i and what hangs on it."""
        move, turn, scale = local[i]
        matrix = np.eye(4)
        matrix[:3, :3] = unitquat_to_rotmat(np.array(turn, np.float64)) * scale
        matrix[:3, 3] = move
        found[document.nodes[i].name] = (above @ matrix)[:3, 3]
        for child in document.nodes[i].children or []:
            visit(child, above @ matrix)

    for top in document.scenes[document.scene].nodes:
        visit(top, np.eye(4))
    return found


def test_a_glb_keeps_mesh_and_skin_and_moves_as_the_motion(person, skinned, tmp_path):
    moved = to_rig(person, Character.read(skinned).rig)
    write_motion(person, tmp_path / "out.glb", onto=skinned)
    before, after = (pygltflib.GLTF2().load(str(p)) for p in (skinned, tmp_path / "out.glb"))
    assert [node.name for node in after.nodes] == [node.name for node in before.nodes]
    plain, ours = (Character.read(file).file.document for file in (skinned, tmp_path / "out.glb"))
    assert all(ours[key] == plain[key] for key in ("meshes", "skins", "materials", "nodes", "scenes"))
    assert after.binary_blob()[: len(before.binary_blob())] == before.binary_blob()
    for frame in (0, 9, 19):
        found = worlds(after, frame)
        for joint, position in zip(moved.skeleton.joints, moved.positions[frame], strict=True):
            np.testing.assert_allclose(found[joint], position, atol=1e-4)


@pytest.mark.parametrize("generator", ["motionary", "another program"])
def test_a_glb_reads_back_at_the_motion_s_rate(person, skinned, tmp_path, generator):
    """Whatever the rate was that the character's own animation had."""
    file = GltfFile.read(skinned)
    document, data = file.document, file.data
    document["asset"] |= {"generator": generator}
    skinned.write_bytes(packed(document, data))
    faster = Motion(person.positions, 60, person.skeleton, person.rotations)
    again = read_motion(write_motion(faster, tmp_path / "out.glb", onto=skinned))
    assert (again.fps, again.frames) == (60, faster.frames)


REFUSED = {
    "joints again and again": (lambda d: d["skins"][0].update(joints=d["skins"][0]["joints"] * 30), "1 to 500 nodes"),
    "a skin of nothing": (lambda d: d["skins"].append({"joints": []}), "skin 1, joints"),
    "no such bind": (lambda d: d["skins"][0].update(inverseBindMatrices=9999), "inverseBindMatrices"),
    "truth for a number": (lambda d: d["nodes"][3].update(translation=[True, 0, 0]), "3 finite numbers"),
    "text for numbers": (lambda d: d["nodes"][3].update(translation=["1", "2", "3"]), "3 finite numbers"),
    "far away": (lambda d: d["nodes"][3].update(translation=[1e30, 0, 0]), "node 3.*must rest within"),
    "huge": (lambda d: d["nodes"][3].update(scale=[1e300] * 3), "node 3.*must rest within"),
    "huge above": (lambda d: d["nodes"][23].update(translation=[1e200] * 3), "node 23.*must rest within"),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", REFUSED)
def test_characters_whose_motion_could_not_be_read_back_are_refused(person, skinned, tmp_path, kind):
    change, rule = REFUSED[kind]
    file = GltfFile.read(skinned)
    document, data = file.document, file.data
    change(document)
    (tmp_path / "rig.glb").write_bytes(packed(document, data))
    with pytest.raises(InputError, match=rf"rig\.glb.*{rule}"):
        write_motion(person, tmp_path / "out.glb", onto=tmp_path / "rig.glb")


def test_an_a_posed_glb_gets_the_source_s_arms(person, skinned):
    moved = person.to(skinned)
    for side in ("left", "right"):
        j = person.skeleton.roles[f"{side}_elbow"]
        bones = [m.positions[:, j] - m.positions[:, m.skeleton.parents[j]] for m in (person, moved)]
        cosine = (bones[0] * bones[1]).sum(-1) / np.prod([np.linalg.norm(b, axis=-1) for b in bones], axis=0)
        assert cosine.min() > np.cos(np.radians(1))


def test_other_formats_take_the_rig_too(person, character, tmp_path):
    path, _ = character
    write_motion(person, tmp_path / "out.npz", onto=path)
    assert read_motion(tmp_path / "out.npz").skeleton == person.to(path).skeleton


def test_what_is_no_character_is_refused(person, tmp_path):
    person.save(tmp_path / "bare.glb", mesh=False)
    (tmp_path / "text.glb").write_bytes(b"no glTF at all, but long enough")
    (tmp_path / "cut.glb").write_bytes((tmp_path / "bare.glb").read_bytes()[:300])
    for name, match in (("bare", "skin"), ("text", "glTF 2.0"), ("cut", "truncated")):
        with pytest.raises(InputError, match=match):
            write_motion(person, tmp_path / "out.glb", onto=tmp_path / f"{name}.glb")
    assert not (tmp_path / "out.glb").exists()


def test_amass_npz_places_the_joints_by_smpl_s_rule(person, tmp_path):
    """Read back by the rule of the body model: x = R (v - J0) + J0 + trans about the pelvis, z up."""
    body = Skeleton.named("smpl22").with_offsets(SMPL_OFFSETS)
    moved = person.to(body)
    person.save(tmp_path / "a.npz", layout="amass")
    with np.load(tmp_path / "a.npz") as data:
        assert data["poses"].shape == (person.frames, 156)
        assert data["betas"].shape == (16,)
        assert float(data["mocap_framerate"]) == person.fps
        poses, trans = data["poses"].reshape(-1, 52, 3), data["trans"]
    assert not poses[:, 22:].any()
    angle = np.linalg.norm(poses, axis=-1, keepdims=True)
    assert angle.max() <= np.pi + 1e-9
    q = np.concatenate([poses / np.maximum(angle, 1e-12) * np.sin(angle / 2), np.cos(angle / 2)], -1)
    turned = unitquat_to_rotmat(q[:, :22])
    positions = np.zeros((person.frames, 22, 3))
    positions[:, 0] = trans + SMPL_ROOT
    for j, p in enumerate(body.parents[1:], 1):
        positions[:, j] = positions[:, p] + turned[:, p] @ SMPL_OFFSETS[j]
        turned[:, j] = turned[:, p] @ turned[:, j]
    np.testing.assert_allclose(positions[..., [0, 2, 1]] * np.array([1, 1, -1]), moved.positions, atol=1e-5)
    again = read_motion(tmp_path / "a.npz", up="z")
    np.testing.assert_allclose(again.positions, moved.positions, atol=1e-4)
    with pytest.raises(InputError, match="layout"):
        person.save(tmp_path / "b.npz", layout="smplx")
