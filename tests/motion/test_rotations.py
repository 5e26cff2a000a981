"""The kit of rotations: closed forms, round trips near 0 and pi, and agreement with scipy and roma."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from motionary.motion.rotations import (
    euler_to_rotmat,
    euler_to_unitquat,
    hat,
    orthogonal,
    quat_action,
    quat_conjugation,
    quat_continuation,
    quat_product,
    rotmat_to_unitquat,
    sixd_to_rotmat,
    special_procrustes,
    unitquat_slerp,
    unitquat_to_euler_zxy,
    unitquat_to_rotmat,
    unitvectors_to_rotmat,
    vectors_to_rotmat,
)

ANGLES = (0.0, 1e-12, 1e-8, 1e-4, 1.0, np.pi / 2, np.pi - 1e-4, np.pi - 1e-8, np.pi)


@pytest.fixture
def q():
    """(5, 7, 4) unit quaternions."""
    return Rotation.random(35, rng=np.random.default_rng(0)).as_quat().reshape(5, 7, 4)


@pytest.fixture
def p(q):
    return np.roll(q, 3, axis=1)[::-1].copy()


def scipy_of(q):
    return Rotation.from_quat(np.reshape(q, (-1, 4)))


def about(axis, angle):
    return np.append(np.sin(angle / 2) * np.asarray(axis), np.cos(angle / 2))


def same_rotation(a, b, atol=1e-12):
    np.testing.assert_allclose(np.abs((a * b).sum(-1)), 1, atol=atol)


def test_quarter_turns_by_hand():
    x, y, z = (about(axis, np.pi / 2) for axis in np.eye(3))
    np.testing.assert_allclose(quat_action(z, np.array([1.0, 0, 0])), [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(quat_action(x, np.array([0.0, 1, 0])), [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(quat_action(y, np.array([0.0, 0, 1])), [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(quat_product(z, x), [0.5, 0.5, 0.5, 0.5], atol=1e-15)  # x, then z: cyclic
    for axis in range(3):
        np.testing.assert_allclose(
            unitquat_to_rotmat(about(np.eye(3)[axis], 0.7)), euler_to_rotmat(axis, 0.7), atol=1e-15
        )


def test_products_and_actions_agree_with_scipy_and_matrices(q, p):
    np.testing.assert_allclose(
        unitquat_to_rotmat(quat_product(q, p)), unitquat_to_rotmat(q) @ unitquat_to_rotmat(p), atol=1e-14
    )
    same_rotation(quat_product(q, p).reshape(-1, 4), (scipy_of(q) * scipy_of(p)).as_quat())
    v = np.random.default_rng(1).normal(size=(5, 7, 3))
    np.testing.assert_allclose(quat_action(q, v).reshape(-1, 3), scipy_of(q).apply(v.reshape(-1, 3)), atol=1e-14)
    np.testing.assert_allclose(quat_product(q, quat_conjugation(q)), np.broadcast_to([0, 0, 0, 1], q.shape), atol=1e-15)


def test_components_may_lie_along_any_axis_and_one_may_be_broadcast(q, p):
    first = quat_product(np.moveaxis(q, -1, 0), np.moveaxis(p, -1, 0), axis=0)
    np.testing.assert_array_equal(np.moveaxis(first, 0, -1), quat_product(q, p))
    np.testing.assert_array_equal(quat_product(q[0, 0], p), quat_product(np.broadcast_to(q[0, 0], p.shape), p))


def test_matrices_agree_with_roma_and_come_back(q):
    torch, roma = pytest.importorskip("torch"), pytest.importorskip("roma")
    matrices = unitquat_to_rotmat(q)
    np.testing.assert_allclose(matrices, roma.unitquat_to_rotmat(torch.from_numpy(q)).numpy(), atol=1e-15)
    np.testing.assert_allclose(unitquat_to_rotmat(q.astype(np.float32) * 1.01), matrices, atol=1e-6)
    same_rotation(rotmat_to_unitquat(matrices), roma.rotmat_to_unitquat(torch.from_numpy(matrices)).numpy())
    same_rotation(rotmat_to_unitquat(matrices), q)


@pytest.mark.parametrize("angle", ANGLES)
def test_round_trips_from_no_turn_to_a_half_turn(angle):
    """A quaternion's vector part is the sine of half the angle: small turns must keep all of their digits."""
    for axis in [*np.eye(3), *-np.eye(3), np.array([0.6, 0, 0.8]), np.array([1, -2, 2]) / 3]:
        turn = about(axis, angle)
        again = rotmat_to_unitquat(unitquat_to_rotmat(turn))
        again *= np.sign(again @ turn)
        np.testing.assert_allclose(again, turn, atol=1e-15, rtol=1e-12)


@pytest.mark.parametrize("angle", ANGLES)
def test_the_least_rotation_has_the_angle_between_its_vectors(angle):
    rng = np.random.default_rng(2)
    start = rng.normal(size=(20, 3))
    start /= np.linalg.norm(start, axis=-1, keepdims=True)
    end = np.cos(angle) * start + np.sin(angle) * orthogonal(start)
    for turn in (unitvectors_to_rotmat(start, end), vectors_to_rotmat(3 * start, 0.2 * end)):
        np.testing.assert_allclose((turn @ start[..., None])[..., 0], end, atol=1e-7)
        np.testing.assert_allclose(turn @ turn.swapaxes(-1, -2), np.broadcast_to(np.eye(3), turn.shape), atol=1e-10)
        np.testing.assert_allclose(np.linalg.det(turn), 1, atol=1e-10)
        np.testing.assert_allclose(Rotation.from_matrix(turn).magnitude(), angle, atol=1e-7)


def test_vectors_without_length_turn_nothing():
    zero, some = np.zeros(3), np.array([0.0, 2, 0])
    for start, end in ((zero, some), (some, zero), (zero, zero)):
        np.testing.assert_array_equal(vectors_to_rotmat(start[None], end[None]), np.eye(3)[None])


@pytest.mark.parametrize("letters", ["ZXY", "XYZ", "YZX", "ZYX", "XZ", "Y", "XYX"])
def test_euler_angles_agree_with_scipy(letters):
    angles = np.random.default_rng(3).uniform(-3, 3, size=(4, 6, len(letters)))
    found = euler_to_unitquat(["XYZ".index(letter) for letter in letters], angles)
    expected = Rotation.identity(24)
    for letter, angle in zip(letters, angles.reshape(24, -1).T, strict=True):
        expected = expected * Rotation.from_euler(letter, angle[:, None])
    same_rotation(found.reshape(-1, 4), expected.as_quat())


@pytest.mark.parametrize("pitch", [0.0, 1.0, np.pi / 2 - 1e-3, np.pi / 2, -np.pi / 2])
def test_zxy_angles_give_the_rotation_back_at_the_poles_too(pitch):
    angles = np.array([[a, pitch, c] for a in (-3.0, 0.0, 2.0) for c in (-1.0, 0.0, 3.0)])
    turn = euler_to_unitquat([2, 0, 1], angles)
    again = unitquat_to_euler_zxy(turn)
    same_rotation(euler_to_unitquat([2, 0, 1], again), turn)
    if abs(pitch) < 1.5:
        np.testing.assert_allclose(again, angles, atol=1e-12)


def test_six_numbers_are_the_first_two_columns(q):
    matrices = unitquat_to_rotmat(q)
    sixd = np.concatenate([matrices[..., 0], matrices[..., 1]], -1)
    np.testing.assert_allclose(sixd_to_rotmat(sixd), matrices, atol=1e-14)
    # Zhou et al. 2019: lengths, and what the second column has of the first, play no part.
    skewed = np.concatenate([2 * sixd[..., :3], 3 * sixd[..., 3:] - 5 * sixd[..., :3]], -1)
    np.testing.assert_allclose(sixd_to_rotmat(skewed), matrices, atol=1e-13)
    for degenerate in (np.zeros(6), np.array([1.0, 0, 0, 1, 0, 0]), np.array([0.0, 0, 0, 1, 2, 3])):
        turn = sixd_to_rotmat(degenerate)
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(turn) == pytest.approx(1)


def test_procrustes_finds_the_rotation_and_never_a_reflection(q):
    matrices = unitquat_to_rotmat(q)
    points = np.random.default_rng(4).normal(size=(8, 3))
    moved = points @ matrices.swapaxes(-1, -2)
    np.testing.assert_allclose(special_procrustes(moved.swapaxes(-1, -2) @ points), matrices, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(special_procrustes(-moved.swapaxes(-1, -2) @ points)), 1)


def test_hat_is_the_cross_product():
    a, b = np.random.default_rng(5).normal(size=(2, 4, 3))
    np.testing.assert_allclose((hat(a) @ b[..., None])[..., 0], np.cross(a, b), atol=1e-15)


def test_slerp_agrees_with_scipy_and_takes_the_shorter_way():
    start, end = about([0, 0, 1.0], 0.3), about([0.6, 0.8, 0], 2.0)
    share = np.linspace(0, 1, 9)
    expected = Slerp([0, 1], Rotation.from_quat(np.stack([start, end])))(share).as_quat()
    for sign in (1, -1):
        tile = lambda value: np.tile(value, (9, 1, 1))  # noqa: E731
        same_rotation(unitquat_slerp(tile(start), tile(sign * end), share)[:, 0], expected)


def test_signs_are_continued_over_time(q):
    turn = np.stack([about([0, 1.0, 0], angle) for angle in np.linspace(0, 4 * np.pi, 60)])[:, None]
    signs = np.random.default_rng(6).choice([-1.0, 1.0], size=(60, 1, 1))
    continued = quat_continuation(turn * signs)
    np.testing.assert_array_equal(continued, turn * signs[0])
    for shape in ((60, 4), (60, 1, 1, 4)):
        np.testing.assert_array_equal(quat_continuation((turn * signs).reshape(shape)), continued.reshape(shape))
    assert quat_continuation(q.astype(np.float32)).dtype == np.float32


def test_the_kit_needs_no_torch():
    code = """
import sys
import numpy as np
from motionary.motion import rotations as r
r.vectors_to_rotmat(np.eye(3), -np.eye(3))
r.unitquat_to_euler_zxy(r.rotmat_to_unitquat(r.sixd_to_rotmat(np.ones((2, 6)))))
sys.exit('torch' in sys.modules or 'scipy' in sys.modules)
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
