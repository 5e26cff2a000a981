"""The .glb parsed back: nodes move as the motion does, the skin follows them, and the file obeys glTF's rules."""

from __future__ import annotations

import numpy as np
import pygltflib as gl
import pytest

from motionary.errors import InputError
from motionary.formats.render.mesh import mannequin, rest_positions
from motionary.motion import Motion, Skeleton
from motionary.motion.rotations import unitquat_to_rotmat

TYPES = {gl.FLOAT: np.float32, gl.UNSIGNED_BYTE: np.uint8, gl.UNSIGNED_SHORT: np.uint16, gl.UNSIGNED_INT: np.uint32}
WIDTH = {gl.SCALAR: 1, gl.VEC3: 3, gl.VEC4: 4, gl.MAT4: 16}


def array(document: gl.GLTF2, index: int) -> np.ndarray:
    accessor = document.accessors[index]
    view = document.bufferViews[accessor.bufferView]
    kind = np.dtype(TYPES[accessor.componentType])
    assert view.byteOffset % 4 == 0
    data = document.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
    values = np.frombuffer(data, kind).reshape(accessor.count, WIDTH[accessor.type])
    if accessor.min:
        np.testing.assert_allclose(values.min(0), accessor.min)
        np.testing.assert_allclose(values.max(0), accessor.max)
    return values


def worlds(document: gl.GLTF2, frame: int) -> np.ndarray:
    """Global matrices (nodes, 4, 4) at a frame, from the parsed file alone."""
    local = []
    for node in document.nodes:
        matrix = np.eye(4)
        matrix[:3, :3] = unitquat_to_rotmat(np.array(node.rotation or [0, 0, 0, 1.0]))
        matrix[:3, 3] = node.translation or 0
        local.append(matrix)
    (animation,) = document.animations
    for channel in animation.channels:
        values = array(document, animation.samplers[channel.sampler].output)[frame]
        if channel.target.path == "rotation":
            local[channel.target.node][:3, :3] = unitquat_to_rotmat(values)
        else:
            local[channel.target.node][:3, 3] = values
    world = list(local)
    for i, node in enumerate(document.nodes):  # parents stand before their children
        for child in node.children or []:
            world[child] = world[i] @ local[child]
    return np.array(world)


def skinned(document: gl.GLTF2, frame: int) -> np.ndarray:
    """Vertices (V, 3) at a frame."""
    attributes = document.meshes[0].primitives[0].attributes
    inverse = array(document, document.skins[0].inverseBindMatrices).reshape(-1, 4, 4).transpose(0, 2, 1)
    matrices = worlds(document, frame)[document.skins[0].joints] @ inverse
    points = np.pad(array(document, attributes.POSITION), ((0, 0), (0, 1)), constant_values=1)
    joints, weights = array(document, attributes.JOINTS_0), array(document, attributes.WEIGHTS_0)
    np.testing.assert_allclose(weights.sum(1), 1, atol=1e-5)
    return np.einsum("vk,vkij,vj->vi", weights, matrices[joints], points)[:, :3]


def test_nodes_move_as_the_motion_does(person, tmp_path):
    person.save(tmp_path / "a.glb")
    document = gl.GLTF2().load(str(tmp_path / "a.glb"))
    assert [node.name for node in document.nodes[:22]] == list(person.skeleton.joints)
    sampler = document.animations[0].samplers[0]
    np.testing.assert_allclose(array(document, sampler.input)[:, 0], np.arange(person.frames) / person.fps, rtol=1e-6)
    for frame in (0, 7, 19):
        np.testing.assert_allclose(worlds(document, frame)[:22, :3, 3], person.positions[frame], atol=1e-3)


def test_mannequin_fits_and_follows_the_joints(person, tmp_path):
    person.save(tmp_path / "a.glb")
    document = gl.GLTF2().load(str(tmp_path / "a.glb"))
    assert len(mannequin(person.skeleton).vertices) > 10_000
    for frame in (0, 12):
        points, joints = skinned(document, frame), person.positions[frame]
        away = np.linalg.norm(points[:, None] - joints[None], axis=-1)
        assert away.min(1).max() < 0.33  # no vertex flies away
        assert away.min(0).max() < 0.12  # the body surrounds every joint
        low, high = points.min(0), points.max(0)
        assert (low < joints.min(0) + 0.03).all()
        assert (high > joints.max(0) - 0.03).all()


def test_positions_alone_get_rotations(person, tmp_path):
    Motion(person.positions, person.fps, person.skeleton).save(tmp_path / "a.glb")
    document = gl.GLTF2().load(str(tmp_path / "a.glb"))
    for frame in (0, 19):
        np.testing.assert_allclose(worlds(document, frame)[:22, :3, 3], person.positions[frame], atol=1e-3)
    paths = [channel.target.path for channel in document.animations[0].channels]
    assert paths.count("translation") == 1


def test_neighbouring_quaternions_never_flip(person, tmp_path):
    signs = np.where(np.arange(person.frames) % 2, -1, 1)[:, None, None]
    Motion(person.positions, person.fps, person.skeleton, person.rotations * signs).save(tmp_path / "a.glb")
    document = gl.GLTF2().load(str(tmp_path / "a.glb"))
    for channel in document.animations[0].channels:
        if channel.target.path == "rotation":
            q = array(document, document.animations[0].samplers[channel.sampler].output)
            assert ((q[1:] * q[:-1]).sum(-1) > 0).all()


@pytest.mark.real
@pytest.mark.parametrize("name", ["cc_02_01", "cmu_08_02", "daz_salsa_10", "bandai_dataset-2_walk_active_003"])
def test_other_rigs_have_capsules_that_follow(shared_data, tmp_path, name):
    from motionary.formats import read_motion

    motion = read_motion(shared_data / "bvh" / "motions" / f"{name}.bvh").crop(0, 30)
    motion.save(tmp_path / "a.glb")
    document = gl.GLTF2().load(str(tmp_path / "a.glb"))
    roles = list(motion.skeleton.roles.values())
    for frame in (0, 29):
        joints = worlds(document, frame)[: len(motion.skeleton.joints), :3, 3]
        np.testing.assert_allclose(joints, motion.positions[frame], atol=1e-3)
        away = np.linalg.norm(skinned(document, frame)[:, None] - motion.positions[frame, roles][None], axis=-1)
        assert away.min(0).max() < 0.15
        assert away.min(1).max() < 0.35


def test_moving_bones_are_translated(person, tmp_path):
    positions = person.positions.copy()
    positions[:, 15] += np.linspace(0, 0.1, person.frames)[:, None] * np.array([0, 1, 0], np.float32)  # the head rises
    motion = Motion(positions, person.fps, person.skeleton, person.rotations)
    motion.save(tmp_path / "a.glb")
    document = gl.GLTF2().load(str(tmp_path / "a.glb"))
    np.testing.assert_allclose(worlds(document, 19)[:22, :3, 3], positions[19], atol=1e-3)


def test_mannequin_is_whole_on_another_size(person):
    small = person.skeleton.with_offsets(person.skeleton.offsets * 0.7)
    vertices, rest = mannequin(small).vertices, rest_positions(small)
    height = np.ptp(rest[:, 1])
    assert height < np.ptp(vertices[:, 1]) < height * 1.35
    normals = mannequin(small).normals
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, atol=1e-3)
    outward = ((vertices - vertices.mean(0)) * normals).sum(-1)
    assert (outward > 0).mean() > 0.6


def test_without_mesh_and_on_one_frame(person, tmp_path):
    person.crop(3, 4).save(tmp_path / "a.glb", mesh=False)
    document = gl.GLTF2().load(str(tmp_path / "a.glb"))
    assert not document.meshes
    np.testing.assert_allclose(worlds(document, 0)[:22, :3, 3], person.positions[3], atol=1e-3)


def test_a_chain_without_roles(tmp_path):
    skeleton = Skeleton.from_rig("snake", ["a", "b", "c"], [-1, 0, 1], np.array([[0, 0, 0], [0, 0.5, 0], [0, 0.5, 0]]))
    motion = Motion(np.zeros((3, 3, 3)) + np.array([[0, 0, 0], [0, 0.5, 0], [0, 1, 0]]), 20, skeleton)
    motion.save(tmp_path / "a.glb")
    document = gl.GLTF2().load(str(tmp_path / "a.glb"))
    np.testing.assert_allclose(worlds(document, 1)[:3, :3, 3], motion.positions[1], atol=1e-4)


def test_existing_file_stays(person, tmp_path):
    (tmp_path / "a.glb").write_text("precious")
    with pytest.raises(InputError, match="force"):
        person.save(tmp_path / "a.glb", force=False)
    assert (tmp_path / "a.glb").read_text() == "precious"
