"""TEMOS's two codecs: sizes, round trips on several skeletons, one heading, closed forms, bad input."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from motionary.errors import InputError
from motionary.features import Rifke, Rotations, codec
from motionary.metrics.position import geodesic_distance
from motionary.motion import Motion, Skeleton, fit_rotations, forward_kinematics, heading
from motionary.motion.facing import rotate_y
from motionary.motion.rotations import quat_product

SMPL, KIT = Skeleton.named("smpl22"), Skeleton.named("kit21")
ALONE = Skeleton.from_json({**SMPL.to_json(), "name": "longer legs"}).with_offsets(SMPL.offsets * 1.3)
SKELETONS = [SMPL, KIT, ALONE]


def turning_body(skeleton: Skeleton, frames: int = 400, turns: float = 2.3) -> Motion:
    """A body that turns, walks about and bends every joint."""
    rng = np.random.default_rng(3)
    time = np.linspace(0, 2 * np.pi, frames)
    axes = rng.normal(size=(len(skeleton), 3))
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    half = 0.3 * np.sin(time[:, None] * rng.integers(1, 5, len(skeleton)) + rng.uniform(0, 6, len(skeleton)))
    rotations = np.concatenate([np.sin(half)[..., None] * axes, np.cos(half)[..., None]], -1)
    yaw = 0.8 + turns * time
    turn = np.stack([0 * yaw, np.sin(yaw / 2), 0 * yaw, np.cos(yaw / 2)], -1)
    rotations[:, 0] = quat_product(turn, rotations[:, 0])
    root = np.array([2.0, 0.9, -1.0]) + np.cumsum(rng.normal(size=(frames, 3)) * [0.03, 0.002, 0.03], axis=0)
    return Motion(forward_kinematics(skeleton, rotations, root), 20, skeleton, rotations)


def ahead(motion: Motion) -> np.ndarray:
    """Positions from the origin on, turned so that the first frame faces +z."""
    positions = motion.positions.astype(np.float64) - motion.positions[0, 0] * [1, 0, 1]
    return rotate_y(positions, -heading(motion)[0])


@pytest.mark.parametrize(
    ("skeleton", "form", "dim"), [(KIT, "rifke", 64), (SMPL, "rotation", 135), (SMPL, "rifke", 67)]
)
def test_sizes_are_the_papers_and_groups_tile_the_columns(skeleton, form, dim):
    made = codec(form, skeleton)
    assert made.dim == dim
    columns = np.concatenate([np.arange(dim)[part] for part in made.slices.values()])
    np.testing.assert_array_equal(columns, np.arange(dim))
    encoded = made.encode(turning_body(skeleton, 30))
    assert (encoded.shape, encoded.dtype) == ((29, dim), np.float32)
    assert made.encode(turning_body(skeleton, 30).crop(0, 1)).shape == (0, dim)


@pytest.mark.parametrize("skeleton", SKELETONS)
@pytest.mark.parametrize("form", [Rifke, Rotations])
def test_positions_return_to_a_hundredth_of_a_millimetre(skeleton, form):
    motion, made = turning_body(skeleton), form(skeleton)
    back = made.decode(made.encode(motion), fps=20)
    np.testing.assert_allclose(back.positions, ahead(motion)[:-1], atol=1e-5)
    assert heading(back)[0] == pytest.approx(0, abs=1e-5)
    assert back.positions[0, 0, [0, 2]] == pytest.approx([0, 0])


@pytest.mark.parametrize("skeleton", SKELETONS)
def test_rotations_return(skeleton):
    motion, made = turning_body(skeleton), Rotations(skeleton)
    back = made.decode(made.encode(motion), fps=20)
    yaw = -heading(motion)[0]
    expected = motion.rotations[:-1].astype(np.float64)
    expected[:, 0] = quat_product(np.array([0, np.sin(yaw / 2), 0, np.cos(yaw / 2)]), expected[:, 0])
    assert geodesic_distance(back.rotations, expected).max() < 1e-4


@pytest.mark.parametrize("form", [Rifke, Rotations])
def test_features_do_not_know_where_a_motion_starts_nor_faces(form):
    motion, made = turning_body(SMPL, 60), form(SMPL)
    turn = np.array([0, np.sin(0.7), 0, np.cos(0.7)])
    rotations = motion.rotations.astype(np.float64)
    rotations[:, 0] = quat_product(turn, rotations[:, 0])
    positions = np.array([5, 0, -2]) + rotate_y(motion.positions.astype(np.float64), 1.4)
    elsewhere = Motion(positions, 20, SMPL, rotations)
    # Positions of float32 are rounded to half a micrometre at 5 m, and hips stand a hand apart.
    np.testing.assert_allclose(made.encode(elsewhere), made.encode(motion), atol=1e-5)


def test_a_walk_along_a_circle_in_closed_form():
    """A stiff body that turns by 0.1 a frame and steps 0.05 m ahead of itself."""
    rest = forward_kinematics(SMPL, np.tile([0.0, 0, 0, 1], (1, 22, 1)), np.array([[0, 0.9, 0]]))[0].astype(np.float64)
    yaw = 0.1 * np.arange(40)
    steps = 0.05 * np.stack([np.sin(yaw), 0 * yaw, np.cos(yaw)], -1)
    path = np.cumsum(steps, 0) - steps
    positions = rotate_y(np.tile(rest, (40, 1, 1)), yaw[:, None]) + path[:, None]
    made = Rifke(SMPL)
    encoded = made.encode(Motion(positions, 20, SMPL))
    np.testing.assert_allclose(encoded[:, made.slices["root_angular"]], 0.1, atol=1e-5)
    np.testing.assert_allclose(encoded[:, made.slices["root_linear"]], [[0, 0.05]] * 39, atol=1e-5)
    local = encoded[:, made.slices["positions"]].reshape(39, 21, 3)
    # Alike in every frame, and facing ahead: the left hip stands at +x.
    np.testing.assert_allclose(local, np.tile(local[:1], (39, 1, 1)), atol=1e-5)
    assert local[0, SMPL.hips[0] - 1, 0] > 0.03


@pytest.mark.parametrize("form", [Rifke, Rotations])
def test_the_root_path_of_tensors_is_that_of_decoding(form):
    made = form(SMPL)
    encoded = made.encode(turning_body(SMPL, 80))
    path = made.root_path(torch.from_numpy(np.stack([encoded, encoded])).double())
    expected = made.decode(encoded).positions[:, 0][:, [0, 2]]
    np.testing.assert_allclose(path, np.stack([expected, expected]), atol=1e-6)


def test_motion_without_rotations_gets_true_ones():
    motion = turning_body(SMPL, 60)
    bare = Motion(motion.positions, 20, SMPL)
    made = Rotations(SMPL)
    back = made.decode(made.encode(bare))
    assert np.abs(back.positions - ahead(motion)[:-1]).max() < 2e-3  # what fit_rotations promises, and rounding
    assert fit_rotations(back) is back


@pytest.mark.parametrize("form", ["rifke", "rotation"])
def test_bad_input_is_one_line(form):
    made = codec(form, SMPL)
    with pytest.raises(InputError, match="needs the joints of smpl22"):
        made.encode(turning_body(KIT, 8))
    with pytest.raises(InputError, match="shape"):
        made.decode(np.zeros((4, made.dim + 1)))
    with pytest.raises(InputError, match="finite"):
        made.decode(np.full((4, made.dim), np.nan))


@pytest.mark.real
def test_real_clips_return(shared_data):
    files = sorted((shared_data / "captioned").rglob("*.npy"))[::60]
    assert files
    for file in files:
        motion = Motion(np.load(file), 20, SMPL)
        made = Rifke(SMPL)
        np.testing.assert_allclose(made.decode(made.encode(motion)).positions, ahead(motion)[:-1], atol=2e-5)
