"""Lie algebra poses: the maps against roma and finite differences, kinematics in closed form, exact round trips."""

from __future__ import annotations

import math

import numpy as np
import pytest
import roma
import torch

from motionary.corpus.demo import demo_clip
from motionary.errors import InputError
from motionary.features.lie import ForwardKinematics, Lie, least_turn
from motionary.features.so3 import exp_so3, hat_tensor, log_so3
from motionary.motion import Motion, Skeleton

ANGLES = [0.0, 1e-12, 1e-6, 9.9e-3, 1.01e-2, 0.5, 2.0, 3.0, math.pi - 1e-6, math.pi - 1e-9]


def vectors(angles=ANGLES) -> torch.Tensor:
    """Seven axes times each angle, float64."""
    axes = torch.randn(7, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    axes = torch.cat([axes / axes.norm(dim=-1, keepdim=True), torch.eye(3, dtype=torch.float64)])
    return (torch.tensor(angles, dtype=torch.float64)[:, None, None] * axes).flatten(0, 1)


def test_the_hat_of_a_vector_is_its_cross_product():
    a, b = torch.randn(2, 5, 3, generator=torch.Generator().manual_seed(1))
    assert torch.allclose((hat_tensor(a) @ b[..., None])[..., 0], torch.linalg.cross(a, b), atol=1e-6)


def test_both_maps_agree_with_roma():
    w = vectors([*ANGLES, math.pi, 4.0, 9.0])
    assert torch.allclose(exp_so3(w), roma.rotvec_to_rotmat(w), atol=1e-12)
    w = vectors()
    assert torch.allclose(log_so3(exp_so3(w)), w, atol=1e-7)
    assert torch.allclose(log_so3(exp_so3(w)), roma.rotmat_to_rotvec(exp_so3(w)), atol=1e-7)


def test_the_logarithm_of_half_a_turn_is_one_of_its_two():
    w = vectors([math.pi])
    found = log_so3(exp_so3(w))
    assert torch.allclose(found.norm(dim=-1), torch.full((len(w),), math.pi, dtype=torch.float64))
    assert torch.allclose(exp_so3(found), exp_so3(w), atol=1e-9)


def test_gradients_are_those_of_finite_differences():
    w = vectors([0.0, 1e-6, 9.9e-3, 1.01e-2, 0.5, 3.0]).requires_grad_()
    assert torch.autograd.gradcheck(exp_so3, w, eps=1e-6, atol=1e-6)
    # Only motions along rotations are asked of the logarithm: of other matrices it is not defined.
    assert torch.autograd.gradcheck(lambda v: log_so3(exp_so3(v)), w, eps=1e-6, atol=1e-5)


def test_gradients_are_finite_at_zero_and_pi_in_single_precision():
    w = vectors([0.0, 1e-30, math.pi - 1e-7, math.pi]).float().requires_grad_()
    log_so3(exp_so3(w)).square().sum().backward()
    assert torch.isfinite(w.grad).all()
    r = roma.rotvec_to_rotmat(vectors([0.0, math.pi])).float().requires_grad_()
    log_so3(r).sum().backward()
    assert torch.isfinite(r.grad).all()


def test_the_least_turn_brings_x_onto_the_vector():
    v = torch.randn(50, 3, generator=torch.Generator().manual_seed(2), dtype=torch.float64)
    v = torch.cat([v, torch.tensor([[-2.0, 0, 0], [3.0, 0, 0]], dtype=torch.float64)])
    turns = least_turn(v)
    assert torch.allclose(exp_so3(turns)[..., 0] * v.norm(dim=-1, keepdim=True), v, atol=1e-12)
    assert torch.allclose(turns.norm(dim=-1), torch.acos(v[:, 0] / v.norm(dim=-1)), atol=1e-7)
    assert not least_turn(torch.zeros(1, 3)).any()


def chain() -> Skeleton:
    """A root and an arm of two bones, of 2 m and 1 m."""
    return Skeleton.from_rig("arm", ("root", "a", "b"), (-1, 0, 1), np.array([[0, 0, 0], [0, 2, 0], [0, 1, 0]]))


def test_kinematics_in_closed_form():
    placed = ForwardKinematics(chain())
    assert torch.allclose(placed(torch.zeros(3, 3))[:, 1], torch.tensor([0.0, 2, 3]))  # everything along the root's x
    bent = torch.zeros(3, 3)
    bent[1, 2] = math.pi / 2  # about the frame's z, the body's left: from up to ahead
    assert torch.allclose(placed(bent), torch.tensor([[0.0, 0, 0], [0, 0, 2], [0, 0, 3]]), atol=1e-6)
    bent[0, 1] = math.pi / 2  # the body turned to its left, +x
    assert torch.allclose(placed(bent), torch.tensor([[0.0, 0, 0], [2, 0, 0], [3, 0, 0]]), atol=1e-6)
    found = placed(bent, torch.tensor([0.0, 1, 5]))
    assert torch.allclose(found, torch.tensor([[0.0, 0, 0], [1, 0, 0], [6, 0, 0]]), atol=1e-5)


def test_a_turn_of_the_root_turns_the_body_as_one():
    skeleton = Skeleton.named("smpl22")
    placed = ForwardKinematics(skeleton)
    w = 2 * torch.randn(4, 22, 3, generator=torch.Generator().manual_seed(3))
    turned = w.clone()
    turn = roma.rotvec_to_rotmat(torch.tensor([0.4, -1.0, 0.2]))
    turned[:, 0] = log_so3(turn @ exp_so3(w[:, 0]))
    assert torch.allclose(placed(turned), placed(w) @ turn.T, atol=1e-5)
    lengths = (placed(w)[:, 1:] - placed(w)[:, list(skeleton.parents[1:])]).norm(dim=-1)
    assert torch.allclose(lengths, torch.tensor(skeleton.bone_lengths[1:]).expand(4, -1), atol=1e-5)


@pytest.mark.parametrize("index", [0, 3, 9])
def test_a_motion_returns_from_its_features(index):
    motion, _ = demo_clip(index, seed=0)
    codec = Lie(motion.skeleton)
    features, bones = codec.encode(motion), codec.bone_lengths(motion)
    assert features.shape == (motion.frames, codec.dim) == (motion.frames, 69)
    back = codec.decode(features, motion.fps, bones)
    assert np.abs(back.positions - motion.positions).max() < 2e-5
    assert np.abs(codec.encode(back) - features).max() < 1e-4


@pytest.mark.parametrize("seed", range(4))
def test_any_tree_in_any_pose_returns(seed):
    rng = np.random.default_rng(seed)
    parents = [-1, *(int(rng.integers(0, j)) for j in range(1, 15))]
    offsets = rng.normal(size=(15, 3)) * [[0.3]] * (rng.random(15) > 0.15)[:, None]  # some bones have no length
    skeleton = Skeleton.from_rig("tree", [f"j{i}" for i in range(15)], parents, offsets)
    directions = rng.normal(size=(20, 15, 3))
    directions[:, 5] = -directions[:, parents[5]]  # folded onto the bone before
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    positions = np.zeros((20, 15, 3))
    positions[:, 0] = rng.normal(size=(20, 3))
    for joint in range(1, 15):
        positions[:, joint] = positions[:, parents[joint]] + directions[:, joint] * skeleton.bone_lengths[joint]
    codec, motion = Lie(skeleton), Motion(positions, 30, skeleton)
    back = codec.decode(codec.encode(motion), 30)
    assert np.abs(back.positions - positions).max() < 2e-5


def test_a_body_twice_as_large_walks_twice_as_far():
    motion, _ = demo_clip(1)
    codec = Lie(motion.skeleton)
    features, bones = codec.encode(motion), codec.bone_lengths(motion)
    large = codec.decode(features, motion.fps, bones, scale=2.0)
    assert np.allclose(large.positions, 2 * codec.decode(features, motion.fps, bones).positions, atol=1e-5)
    assert np.allclose(large.skeleton.bone_lengths, 2 * motion.skeleton.bone_lengths)


@pytest.mark.parametrize("scale", [0, -1, float("nan"), True, "big"])
def test_a_scale_that_no_body_has(scale):
    codec = Lie(chain())
    with pytest.raises(InputError, match="scale"):
        codec.decode(np.zeros((2, 12)), scale=scale)


def test_motions_of_other_joints_and_broken_features_are_refused():
    codec = Lie(chain())
    with pytest.raises(InputError, match="retarget"):
        codec.encode(demo_clip(0)[0])
    with pytest.raises(InputError, match="shape"):
        codec.decode(np.zeros((2, 11)))
    with pytest.raises(InputError, match="finite"):
        codec.decode(np.full((2, 12), np.nan))
