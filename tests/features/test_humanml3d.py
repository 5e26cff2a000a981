"""The HumanML3D codec: released numbers, round trips, invariances, and nothing but finite values."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import torch

from motionary.errors import InputError
from motionary.features import HumanML3D, codec, recover_positions, recover_positions_torch
from motionary.features.humanml3d import _smooth
from motionary.motion import Motion, Skeleton

SMPL, KIT = Skeleton.named("smpl22"), Skeleton.named("kit21")


def rest(skeleton: Skeleton) -> np.ndarray:
    """(J, 3) joints at rest, the lowest on the floor."""
    joints = np.zeros((len(skeleton), 3))
    for joint, parent in enumerate(skeleton.parents[1:], 1):
        joints[joint] = joints[parent] + skeleton.offsets[joint]
    return joints - [0, joints[:, 1].min(), 0]


def turned(positions: np.ndarray, angle: np.ndarray | float) -> np.ndarray:
    """Positions (T, J, 3) turned by angle (T,) or one angle about +y (+z towards +x)."""
    angle = np.broadcast_to(angle, len(positions))
    cosine, sine, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    matrices = np.stack([cosine, zero, sine, zero, one, zero, -sine, zero, cosine], axis=-1).reshape(-1, 3, 3)
    return np.einsum("tij,tkj->tki", matrices, positions)


def wander(skeleton: Skeleton, frames: int = 90, seed: int = 0, turns: float = 1.0) -> Motion:
    """A body whose joints sway while it turns and walks about."""
    rng = np.random.default_rng(seed)
    time = np.linspace(0, 2 * np.pi, frames)[:, None, None]
    sway = 0.05 * rng.normal(size=(len(skeleton), 3)) * np.sin(time * rng.integers(1, 4, size=(len(skeleton), 1)))
    path = np.cumsum(rng.normal(size=(frames, 1, 3)) * [0.03, 0.001, 0.03], axis=0)
    return Motion(turned(rest(skeleton) + sway, np.linspace(0, 2 * np.pi * turns, frames)) + path, 20, skeleton)


def placed_first(motion: Motion, angle: float) -> np.ndarray:
    """Positions from the origin on, turned back by the first heading."""
    positions = motion.positions.astype(np.float64) - motion.positions[0, 0] * [1, 0, 1]
    return turned(positions, -angle)


def first_heading(positions: np.ndarray, skeleton: Skeleton) -> float:
    hips, shoulders = skeleton.hips, skeleton.shoulders
    across = positions[0, hips[1]] - positions[0, hips[0]] + positions[0, shoulders[1]] - positions[0, shoulders[0]]
    across = -across if skeleton.codec_swaps_sides else across
    return float(np.arctan2(across[2], -across[0]))


@pytest.mark.parametrize(("skeleton", "dim"), [(SMPL, 263), (KIT, 251)])
def test_sizes_and_slices(skeleton, dim):
    features = HumanML3D(skeleton)
    assert features.dim == dim
    columns = np.concatenate([np.arange(dim)[s] for s in features.slices.values()])
    np.testing.assert_array_equal(columns, np.arange(dim))
    encoded = features.encode(wander(skeleton))
    assert encoded.shape == (89, dim)
    assert encoded.dtype == np.float32
    assert features.encode(wander(skeleton).crop(0, 1)).shape == (0, dim)


@pytest.mark.parametrize("skeleton", [SMPL, KIT])
@pytest.mark.parametrize("turns", [0.0, 0.4, 1.7, -3.0])
def test_decoding_returns_the_joints(skeleton, turns):
    motion = wander(skeleton, turns=turns)
    features = HumanML3D(skeleton)
    expected = placed_first(motion, first_heading(motion.positions, skeleton))[:-1]
    np.testing.assert_allclose(features.decode(features.encode(motion)).positions, expected, atol=1e-5)


@pytest.mark.parametrize("skeleton", [SMPL, KIT])
def test_decoding_by_rotations_returns_a_rigid_body(skeleton):
    positions = (
        turned(np.tile(rest(skeleton), (60, 1, 1)), np.linspace(0, 5, 60)) + np.linspace(0, 2, 60)[:, None, None]
    )
    motion = Motion(positions, 20, skeleton)
    features = HumanML3D(skeleton)
    encoded = features.encode(motion)
    by_rotations = features.decode(encoded, rotations=True, fps=10)
    assert by_rotations.fps == 10
    np.testing.assert_allclose(by_rotations.positions, features.decode(encoded).positions, atol=2e-5)


@pytest.mark.parametrize("angle", [0.5, 3.0, -2.0])
def test_features_do_not_know_the_first_heading_and_place(angle):
    motion, features = wander(SMPL), HumanML3D(SMPL)
    elsewhere = Motion(turned(motion.positions, angle) + np.array([4.0, 0, -3]), 20, SMPL)
    np.testing.assert_allclose(features.encode(elsewhere), features.encode(motion), atol=1e-4)


def test_a_straight_walk_in_closed_form():
    positions = np.tile(rest(SMPL), (50, 1, 1)) + np.arange(50)[:, None, None] * np.array([0, 0, 0.06])
    features = HumanML3D(SMPL)
    encoded, at = features.encode(Motion(positions, 20, SMPL)), features.slices
    # The swapped hips show: shoulders minus hips face ahead exactly only in a symmetric body.
    np.testing.assert_allclose(encoded[1:, at["root_angular"]], 0, atol=1e-6)
    np.testing.assert_allclose(np.hypot(*encoded[:, at["root_linear"]].T), 0.06, atol=1e-6)
    np.testing.assert_allclose(encoded[:, at["root_height"]], positions[0, 0, 1], atol=1e-6)
    np.testing.assert_allclose(encoded[1:, at["root_linear"]], [[0, 0.06]] * 48, atol=2e-3)
    np.testing.assert_array_equal(encoded[:, at["contacts"]], 0)
    speeds = np.linalg.norm(encoded[:, at["velocities"]].reshape(-1, 22, 3), axis=-1)
    np.testing.assert_allclose(speeds, 0.06, atol=1e-6)


def test_turning_on_the_spot_in_closed_form():
    """The released angular velocity is half the turn per frame, against the heading's sense."""
    step = 0.05
    positions = turned(np.tile(rest(SMPL), (300, 1, 1)), step * np.arange(300))
    features = HumanML3D(SMPL)
    encoded = features.encode(Motion(positions, 20, SMPL))
    # Far from the ends the filter sees a steady turn; headings pass 180 degrees several times.
    np.testing.assert_allclose(encoded[90:200, 0], -step / 2, atol=1e-4)


def test_kit_takes_sides_as_its_release_does():
    """In KIT-ML's mirrored world the left joints stand at -x of a body that walks towards +z."""
    steps = np.arange(40)[:, None, None] * np.array([0, 0, 0.05])
    mirrored = rest(KIT) * [-1, 1, 1] + steps
    features = HumanML3D(KIT)
    encoded = features.encode(Motion(mirrored, 12.5, KIT))
    assert (encoded[:, 2] > 0.049).all()
    right_foot_first = mirrored.copy()
    right_foot_first[:, list(KIT.feet[2:])] -= steps  # the right foot stands
    contacts = features.encode(Motion(right_foot_first, 12.5, KIT))[:, features.slices["contacts"]]
    assert (contacts[:, :2] == 1).all()


def test_the_facing_filter_is_a_gaussian():
    impulse = np.zeros((401, 2))
    impulse[200] = 1
    smooth = _smooth(impulse)
    expected = np.exp(-0.5 * (np.arange(-80, 81) / 20) ** 2)
    np.testing.assert_allclose(smooth[120:281, 0], expected / expected.sum(), atol=1e-12)
    np.testing.assert_allclose(smooth.sum(0), 1)
    np.testing.assert_allclose(_smooth(np.ones((3, 2))), 1)


def test_torch_recovery_agrees_and_has_gradients():
    encoded = np.stack([HumanML3D(SMPL).encode(wander(SMPL, seed=seed)) for seed in range(3)])
    expected = recover_positions(encoded, 22)
    assert expected.shape == (3, 89, 22, 3)
    found = recover_positions_torch(torch.from_numpy(encoded), 22)
    np.testing.assert_allclose(found.numpy(), expected, atol=2e-5)
    one = recover_positions_torch(torch.from_numpy(encoded[1]), 22)
    np.testing.assert_allclose(one.numpy(), found[1].numpy(), atol=1e-6)
    small = torch.from_numpy(encoded[0, :4].astype(np.float64)).requires_grad_()
    assert torch.autograd.gradcheck(lambda x: recover_positions_torch(x, 22), small)


@pytest.mark.parametrize("frames", [1, 2, 7])
def test_degenerate_bodies_stay_finite(frames):
    flicker = np.tile(rest(SMPL), (frames, 1, 1))
    flicker[::2] = 0
    opposite = np.zeros((22, 3))
    for joint, parent in enumerate(SMPL.parents[1:], 1):
        opposite[joint] = opposite[parent] - 0.1 * SMPL.directions[joint]
    backwards = np.tile(rest(SMPL) * [-1, 1, -1], (frames, 1, 1))
    backwards[:1] = rest(SMPL)
    features = HumanML3D(SMPL)
    for positions in (np.zeros((frames, 22, 3)), flicker, np.tile(opposite, (frames, 1, 1)), backwards):
        encoded = features.encode(Motion(positions, 20, SMPL))
        assert np.isfinite(encoded).all()
        if frames > 1:
            assert np.isfinite(features.decode(encoded, rotations=True).positions).all()


def test_rotations_that_are_none_still_decode():
    """A model may answer with zeros or columns in line."""
    features = HumanML3D(SMPL)
    for frame in (np.zeros((3, 263)), np.ones((3, 263))):
        assert np.isfinite(features.decode(frame, rotations=True).positions).all()


def test_wrong_input_is_refused():
    features = HumanML3D(SMPL)
    for wrong in (np.zeros((3, 251)), np.zeros((0, 263)), np.zeros(263), np.full((3, 263), np.nan)):
        with pytest.raises(InputError, match="features"):
            features.decode(wrong)
    with pytest.raises(InputError, match="smpl22"):
        features.encode(wander(KIT))
    with pytest.raises(InputError, match="humanml3d"):
        codec("rifke3", SMPL)
    assert isinstance(codec("humanml3d", KIT), HumanML3D)


def test_chains_must_reach_every_joint():
    plain = SMPL.to_json()
    for chains in (plain["chains"][:-1], plain["chains"][::-1], plain["chains"] + [[0, 1]]):
        with pytest.raises(InputError, match="chain"):
            HumanML3D(Skeleton.from_json({**plain, "chains": chains}))


def test_geometry_and_features_load_without_torch():
    program = "import sys, motionary.motion, motionary.features; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


@pytest.mark.real
def test_the_released_features_are_reproduced(shared_data):
    folder = shared_data / "humanml3d_sample"
    joints = np.load(folder / "new_joints" / "012314.npy")
    released = np.load(folder / "new_joint_vecs" / "012314.npy")
    features = HumanML3D(SMPL)
    encoded = features.encode(Motion(joints, 20, SMPL))
    difference = np.abs(encoded - released[: len(encoded)])
    # The original had one frame more, which the filter saw from 80 frames before the end on.
    assert difference[:-80].max() < 1e-4
    assert difference.max() < 2e-2
    contacts = features.slices["contacts"]
    np.testing.assert_array_equal(encoded[:, contacts], released[: len(encoded), contacts])
    np.testing.assert_allclose(features.decode(released).positions, joints, atol=1e-5)
    np.testing.assert_allclose(features.decode(encoded).positions, joints[:-1], atol=1e-5)
    np.testing.assert_allclose(features.decode(encoded, rotations=True).positions, joints[:-1], atol=1e-4)


@pytest.mark.real
@pytest.mark.parametrize("folder", ["captioned", "styled", "actions"])
def test_real_clips_stay_finite_and_return(shared_data, folder):
    features = HumanML3D(SMPL)
    with np.errstate(divide="raise", invalid="raise"):
        for path in sorted((shared_data / folder / "motions").glob("*.npy"))[::12]:
            motion = Motion(np.load(path), 20, SMPL)
            encoded = features.encode(motion)
            assert np.isfinite(encoded).all(), path.name
            assert np.isfinite(features.decode(encoded, rotations=True).positions).all(), path.name
            expected = placed_first(motion, first_heading(motion.positions, SMPL))[:-1]
            np.testing.assert_allclose(features.decode(encoded).positions, expected, atol=1e-5, err_msg=path.name)
