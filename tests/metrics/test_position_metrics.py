"""Position errors and angles against known offsets."""

import numpy as np
import pytest

from motionary.errors import InputError
from motionary.metrics import (
    average_position_error,
    average_variance_error,
    geodesic_distance,
    mpjpe,
    position_errors,
)
from motionary.motion import Motion, Skeleton, canonicalize

SMPL = Skeleton.named("smpl22")


def turned(motion, angle, shift=(0, 0, 0)):
    """The motion turned about y by `angle` (to the left) and shifted."""
    c, s = np.cos(angle), np.sin(angle)
    p = motion.positions @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]], np.float32).T + np.float32(shift)
    return Motion(p, motion.fps, motion.skeleton)


@pytest.fixture
def motion():
    rest = np.zeros((22, 3), np.float32)
    for joint, parent in enumerate(SMPL.parents):
        rest[joint] = SMPL.offsets[joint] + (rest[parent] if joint else (0, 1, 0))
    noise = np.random.default_rng(0).normal(0, 0.01, (30, 22, 3))
    walk = np.linspace(0, 1, 30)[:, None, None] * [0, 0, 1]
    return Motion(rest + walk + noise, 20, SMPL)


def test_position_error_of_a_constant_offset(motion):
    shifted = motion.positions + np.float32([0.3, 0, 0.4])
    np.testing.assert_allclose(average_position_error(shifted, motion), np.full(22, 0.5), rtol=1e-5)
    np.testing.assert_allclose(average_variance_error(shifted, motion), np.zeros(22), atol=1e-6)


def test_variance_error_divides_by_frames_minus_one():
    a = np.zeros((2, 1, 3))
    b = np.array([[[0.0, 0, 0]], [[2.0, 0, 0]]])  # variance (0 - 1)^2 + (2 - 1)^2 over 1
    np.testing.assert_allclose(average_variance_error(a, b), [2])


def test_batches_average_over_samples(motion):
    a = np.stack([motion.positions, motion.positions + 1])
    b = np.stack([motion.positions, motion.positions])
    np.testing.assert_allclose(average_position_error(a, b), np.full(22, np.sqrt(3) / 2), rtol=1e-5)


def test_three_kinds_of_joint_error(motion):
    moved = turned(motion, 0.0, (0.03, 0, 0.04))
    assert mpjpe(moved, motion, "global") == pytest.approx(50, rel=1e-4)
    assert mpjpe(moved, motion, "root") == pytest.approx(0, abs=1e-3)
    spun = turned(motion, np.radians(30))
    assert mpjpe(spun, motion, "root") > 50
    assert mpjpe(spun, motion, "local") == pytest.approx(0, abs=1e-3)
    p = motion.positions.copy()
    p[:, 20] += np.float32([0, 0.22, 0])
    assert mpjpe(Motion(p, 20, SMPL), motion, "local") == pytest.approx(10, rel=1e-4)


def test_local_error_is_measured_in_the_bodys_frame(motion):
    p = motion.positions.copy()
    p[:, 20, 2] += 0.1  # the wrist forward, before and after turning the whole body
    a, b = Motion(p, 20, SMPL), motion
    assert mpjpe(turned(a, 2.0), turned(b, -1.0), "local") == pytest.approx(mpjpe(a, b, "local"), rel=1e-3)


def test_temos_rows(motion):
    motion = canonicalize(motion)
    moved = turned(motion, 0.0, (0.3, 1.0, 0.4))
    errors = position_errors([moved, motion], [motion, motion])
    assert errors.ape_trajectory == pytest.approx(0.25, rel=1e-4)  # the height does not count
    assert errors.ape_root == pytest.approx(np.sqrt(1.25) / 2, rel=1e-4)
    assert errors.ape_global == pytest.approx(np.sqrt(1.25) / 2, rel=1e-4)
    assert errors.ape_local == pytest.approx(0.5, rel=1e-4)  # heights stay in the body's frame
    assert errors.ave_root == pytest.approx(0, abs=1e-6)


def test_geodesic_distance_of_known_angles():
    angles = np.array([0, 1e-7, 0.5, np.pi / 2, 3.0, np.pi - 1e-7, np.pi])
    zero = np.array([0, 0, 0, 1.0])
    q = np.stack([np.zeros_like(angles), np.sin(angles / 2), np.zeros_like(angles), np.cos(angles / 2)], -1)
    np.testing.assert_allclose(geodesic_distance(q, zero), angles, atol=1e-12)
    np.testing.assert_allclose(geodesic_distance(-3 * q, zero), angles, atol=1e-12)
    np.testing.assert_allclose(geodesic_distance(zero, q), angles, atol=1e-12)


def test_geodesic_distance_agrees_with_roma_and_is_bi_invariant():
    torch, roma = pytest.importorskip("torch"), pytest.importorskip("roma")
    a, b, c = torch.nn.functional.normalize(torch.tensor(np.random.default_rng(0).normal(size=(3, 50, 4))), dim=-1)
    expected = roma.rotmat_geodesic_distance(roma.unitquat_to_rotmat(a), roma.unitquat_to_rotmat(b))
    np.testing.assert_allclose(geodesic_distance(a, b), expected, atol=1e-6)
    np.testing.assert_allclose(
        geodesic_distance(roma.quat_product(c, a), roma.quat_product(c, b)), geodesic_distance(a, b), atol=1e-9
    )


@pytest.mark.parametrize(
    "call",
    [
        lambda m: average_position_error(m.positions, m.positions[:-1]),
        lambda m: average_variance_error(m.positions[:1], m.positions[:1]),
        lambda m: mpjpe(m, m, "pelvis"),
        lambda m: position_errors([m], []),
        lambda m: geodesic_distance(np.zeros(4), np.ones(4)),
        lambda m: geodesic_distance(np.ones(3), np.ones(3)),
    ],
)
def test_bad_input_is_named(motion, call):
    with pytest.raises(InputError):
        call(motion)
