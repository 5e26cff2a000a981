"""AMASS files on the joints of their own body, from a body model made for tests: few vertices, SMPL's tree."""

from __future__ import annotations

import json
import pickle

import numpy as np
import pytest

from motionary.cli import main
from motionary.errors import InputError, InputWarning
from motionary.formats import read_motion, write_motion
from motionary.formats.read import read_motion_with
from motionary.formats.read.body_model import read_body
from motionary.formats.read.smpl import SMPL_OFFSETS, SMPL_ROOT
from motionary.motion import Skeleton
from motionary.motion.rotations import rotvec_to_unitquat, unitquat_to_rotmat

PARENTS = Skeleton.named("smpl22").parents
RNG = np.random.default_rng(0)
POSES = np.concatenate([RNG.normal(0, 0.3, (30, 66)), RNG.normal(0, 0.3, (30, 90))], axis=1)
TRANS = np.cumsum(RNG.normal(0, 0.01, (30, 3)), axis=0) + np.array([0, 1, 0])
BETAS = RNG.normal(0, 1, 16)
UPRIGHT = {"up": "y"}  # as the poses above are, so that nothing is left to be measured


def made(joints: int = 52, vertices: int = 120, shapes: int = 10) -> dict[str, np.ndarray]:
    """A body model's arrays: the mean body's joints, each the mean of a few vertices, which shapes move."""
    rng = np.random.default_rng(1)
    places = np.zeros((joints, 3))
    places[0] = SMPL_ROOT
    parents = [*PARENTS, *rng.integers(0, 22, joints - 22)]
    for j in range(1, joints):
        offset = SMPL_OFFSETS[j] if j < 22 else rng.normal(0, 0.05, 3)
        places[j] = places[parents[j]] + offset
    regressor = np.zeros((joints, vertices))
    for j in range(joints):
        regressor[j, j * 2 : j * 2 + 2] = 0.5
    template = rng.normal(0, 0.02, (vertices, 3))
    template[1 : 2 * joints : 2] = 2 * places - template[0 : 2 * joints : 2]
    tree = np.array([parents, np.arange(joints)]).astype(np.uint32)  # the root's parent is 4294967295, as in SMPL's
    weights = rng.uniform(size=(vertices, joints))
    return {
        "v_template": template,
        "J_regressor": regressor,
        "shapedirs": rng.normal(0, 0.01, (vertices, 3, shapes)),
        "kintree_table": tree,
        "weights": weights / weights.sum(1, keepdims=True),
    }


@pytest.fixture
def body(tmp_path):
    np.savez(tmp_path / "SMPLH_NEUTRAL.npz", **made())
    return tmp_path / "SMPLH_NEUTRAL.npz"


@pytest.fixture
def take(tmp_path):
    np.savez(tmp_path / "take.npz", poses=POSES, trans=TRANS, betas=BETAS, mocap_framerate=60.0, gender="neutral")
    return tmp_path / "take.npz"


def joints_of(arrays: dict[str, np.ndarray], betas: np.ndarray) -> np.ndarray:
    """(T, 22, 3) by the definition, with matrices and over the vertices."""
    vertices = arrays["v_template"] + arrays["shapedirs"] @ betas
    rest = (arrays["J_regressor"] @ vertices)[:22]
    local = unitquat_to_rotmat(rotvec_to_unitquat(POSES[:, :66].reshape(-1, 22, 3)))
    world, placed = np.empty_like(local), np.empty((len(POSES), 22, 3))
    for j, p in enumerate(PARENTS):
        world[:, j] = local[:, j] if p < 0 else world[:, p] @ local[:, j]
        placed[:, j] = rest[0] + TRANS if p < 0 else placed[:, p] + world[:, p] @ (rest[j] - rest[p])
    return placed


def test_joints_are_those_of_the_file_s_own_body(take, body):
    """Of 16 shape parameters the model has 10; each moves joints by centimetres, and what it lacks is said."""
    motion, reading = read_motion_with(take, body=body, **UPRIGHT)
    expected = joints_of(made(), BETAS[:10])
    np.testing.assert_allclose(motion.positions, expected, atol=1e-5)
    assert any("16 betas and the body model 10" in note for note in reading.notes)
    mean = read_motion(take, **UPRIGHT)
    np.testing.assert_allclose(mean.positions, joints_of(made(), np.zeros(10)), atol=1e-5)
    assert np.abs(mean.positions - motion.positions).max() > 0.02
    assert motion.fps == 60
    lengths = np.linalg.norm(expected[:, 1:] - expected[:, list(PARENTS[1:])], axis=-1).mean(0)
    np.testing.assert_allclose(motion.skeleton.bone_lengths[1:], lengths, atol=1e-5)
    np.testing.assert_array_equal(mean.rotations, motion.rotations)


@pytest.mark.parametrize(("joints", "shapes"), [(24, 10), (52, 16), (55, 400)])
def test_smpl_smplh_and_smplx(tmp_path, take, joints, shapes):
    arrays = made(joints, 2 * joints + 5, shapes)
    np.savez_compressed(tmp_path / "model.npz", **arrays)
    count = min(shapes, 16)
    padded = np.zeros(shapes)
    padded[:count] = BETAS[:count]
    motion = read_motion_with(take, body=tmp_path / "model.npz", **UPRIGHT)[0]
    np.testing.assert_allclose(motion.positions, joints_of(arrays, padded), atol=1e-5)


@pytest.mark.parametrize("shape", ["row", "frames", "changing", "none"])
def test_betas_of_other_shapes(tmp_path, body, shape):
    betas = {"row": BETAS[None, :10], "frames": np.tile(BETAS[:10], (30, 1)), "changing": np.tile(BETAS[:10], (30, 1))}
    arrays = {"poses": POSES, "trans": TRANS, "fps": 60.0}
    if shape != "none":
        arrays["betas"] = betas[shape] + (np.arange(30)[:, None] if shape == "changing" else 0)
    np.savez(tmp_path / "a.npz", **arrays)
    motion, reading = read_motion_with(tmp_path / "a.npz", body=body, **UPRIGHT)
    expected = joints_of(made(), np.zeros(10) if shape == "none" else BETAS[:10])
    np.testing.assert_allclose(motion.positions, expected, atol=1e-5)
    told = {"changing": "betas change over time", "none": "no betas"}.get(shape)
    assert [told in note for note in reading.notes] == [True] if told else reading.notes == ()


def test_a_shell_a_mapping_and_a_clip_s_line_name_it(tmp_path, take, body, capsys):
    from motionary.corpus.clips import reading

    (tmp_path / "mapping.json").write_text(json.dumps({"body": body.name, "up": "y"}))
    expected = joints_of(made(), BETAS[:10])
    by_mapping = read_motion_with(take, tmp_path / "mapping.json")[0]
    by_line = read_motion_with(take, reading(tmp_path, {"body": body.name, "up": "y"}, "clips.jsonl:1"))[0]
    assert main(["convert", str(take), str(tmp_path / "b.npz"), "--body", str(body), "--up", "y"]) == 0
    capsys.readouterr()
    for motion in (by_mapping, by_line, read_motion(tmp_path / "b.npz")):
        np.testing.assert_allclose(motion.positions, expected, atol=1e-5)


def test_pickles_are_never_opened_and_say_how_to_convert_them(tmp_path, take, capsys):
    class Trap:
        def __reduce__(self):
            return open, (str(tmp_path / "opened"), "w")

    path = tmp_path / "SMPL_NEUTRAL.pkl"
    path.write_bytes(pickle.dumps(Trap()))
    assert main(["inspect", str(take), "--body", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert all(word in said for word in ("SMPL_NEUTRAL.pkl", "never loaded", "pickle.load", "np.savez"))
    assert not (tmp_path / "opened").exists()


def test_the_line_about_pickles_makes_a_model_that_is_read(tmp_path, monkeypatch, take):
    """The command that the line shows, run on a pickle as SMPL's are: plain arrays, and a sparse regressor."""
    from scipy.sparse import csc_matrix

    arrays = made()
    (tmp_path / "model.pkl").write_bytes(
        pickle.dumps({**arrays, "J_regressor": csc_matrix(arrays["J_regressor"])}, protocol=2)
    )
    with pytest.raises(InputError) as caught:
        read_motion(take, body=tmp_path / "model.pkl", **UPRIGHT)
    code = caught.value.rule.split('python -c "')[1].rsplit('"', 1)[0]
    monkeypatch.chdir(tmp_path)
    exec(code, {})
    found = read_body(tmp_path / "model.npz")
    np.testing.assert_allclose(found.joints(BETAS[:10]), joints_of_rest(arrays), atol=1e-12)


def joints_of_rest(arrays: dict[str, np.ndarray]) -> np.ndarray:
    return (arrays["J_regressor"] @ (arrays["v_template"] + arrays["shapedirs"] @ BETAS[:10]))[:22]


BROKEN = {
    "template": ({"v_template": np.zeros((120, 2))}, "v_template"),
    "regressor": ({"J_regressor": np.zeros((52, 119))}, "J_regressor"),
    "few joints": ({"J_regressor": np.zeros((20, 120)), "kintree_table": np.zeros((2, 20))}, "J_regressor"),
    "shapes": ({"shapedirs": np.zeros((120, 30))}, "shapedirs|kintree_table"),
    "not finite": ({"shapedirs": np.full((120, 3, 10), np.nan)}, "shapedirs.*finite"),
    "tree": ({"kintree_table": np.zeros((2, 52))}, "kintree_table.*SMPL's 22 joints"),
    "objects": ({"J_regressor": np.array([{}], object)}, "pickled objects"),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_wrong_models_are_named(tmp_path, take, kind):
    change, rule = BROKEN[kind]
    np.savez(tmp_path / "model.npz", **{**made(), **change})
    with pytest.raises(InputError, match=rf"model\.npz.*({rule})") as caught:
        read_motion(take, body=tmp_path / "model.npz")
    assert "\n" not in str(caught.value)


def test_other_files_are_no_models(tmp_path, take, person):
    for value, rule in (
        (tmp_path / "absent.npz", "does not exist"),
        (take, "without v_template"),
        (5, "the path of a"),
    ):
        with pytest.raises(InputError, match=rule):
            read_motion(take, body=value)
    (tmp_path / "model.txt").write_text("x")
    with pytest.raises(InputError, match=r"must be an \.npz"):
        read_motion(take, body=tmp_path / "model.txt")


def test_files_without_a_shape_say_that_it_was_left_aside(tmp_path, person, body):
    write_motion(person, tmp_path / "a.bvh")
    with pytest.warns(InputWarning, match="body model was left aside"):
        read_motion(tmp_path / "a.bvh", body=body, up="y", unit="cm", mirror=False)


def test_a_model_that_is_replaced_is_read_anew(tmp_path, take, body):
    before = read_body(body)
    assert read_body(body) is before
    np.savez(body, **made(shapes=12))
    assert read_body(body).shapes.shape == (22, 3, 12)
