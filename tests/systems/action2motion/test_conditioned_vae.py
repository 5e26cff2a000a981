"""The conditioned temporal VAE: its decoders, its losses in closed form, and what it can learn."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from acted import LABELS, acted_context, make_acted

from motionary.errors import InputError
from motionary.nn.poses import to_joints, to_poses
from motionary.systems.action2motion.conditioned_vae import Action2Motion, Action2MotionConfig
from motionary.systems.action2motion.pose_decoders import DECODERS

SMALL = Action2MotionConfig(LABELS, width=16, latent=4, upstream=3)


def make(context, seed: int = 0, **settings) -> Action2Motion:
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        return Action2Motion(replace(SMALL, **settings), acted_context(context))


def rng(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def test_poses_and_joints_are_inverse():
    joints = torch.randn(2, 9, 22, 3, generator=rng())
    poses = to_poses(joints, 12.5)
    assert poses.shape == (2, 9, 66)
    assert torch.allclose(to_joints(poses, 12.5), joints, atol=1e-5)
    walked = joints + torch.tensor([3.0, 0, -1])
    assert torch.allclose(to_poses(walked, 12.5)[:, 1:], poses[:, 1:], atol=1e-4)  # only the first step tells the place


@pytest.mark.parametrize("decoder", [name for name in DECODERS if name != "plain"])
def test_lie_decoders_keep_the_bones(context, decoder):
    model = make(context, decoder=decoder)
    hidden, before = torch.randn(3, 5, 16, generator=rng()), torch.randn(3, 5, 66, generator=rng(1))
    joints = to_joints(model.decoder(hidden, before, None)[0], 20.0)
    skeleton = context.skeleton
    lengths = (joints[..., 1:, :] - joints[..., list(skeleton.parents[1:]), :]).norm(dim=-1)
    assert torch.allclose(lengths, torch.tensor(skeleton.bone_lengths[1:]).expand_as(lengths), atol=1e-4)


def test_glmi_moves_the_root_by_what_the_poses_do(context):
    hidden, before = torch.randn(2, 4, 16, generator=rng()), torch.randn(2, 4, 66, generator=rng(1))
    for decoder, moves in (("lie", False), ("glmi_m", True), ("glmi_r", True)):
        model = make(context, decoder=decoder).decoder
        other = before.clone()
        other[:, 1, 10] += 1.0
        one, two = model(hidden, before, None)[0], model(hidden, other, None)[0]
        assert torch.equal(one[..., 3:], two[..., 3:])
        assert bool((one[:, 1, :3] != two[:, 1, :3]).any()) == moves
        # Only a recurrent one remembers it.
        assert bool((one[:, 2:, :3] != two[:, 2:, :3]).any()) == (decoder == "glmi_r")
        # Where the root was has no say.
        other = before.clone()
        other[..., :3] += 1
        assert torch.equal(model(hidden, other, None)[0], one)


def test_the_terms_in_closed_form(context):
    """A constant error of the root's velocity: read truly it stays, read on its own it grows with every frame."""
    model, poses = make(context), torch.zeros(2, 4, 66)
    found = poses.clone()
    found[..., 0] = 20.0 * 0.1  # 0.1 m a frame at 20 fps
    valid = torch.ones(2, 4, dtype=torch.bool)
    terms = model._terms(found, poses, torch.tensor([True, False]), valid)
    forced, free = 22 * 0.1, 22 * 0.1 * (1 + 2 + 3 + 4) / 4
    assert float(terms["joints"][1]) == pytest.approx((forced + free) / 2, rel=1e-3)
    assert terms["alignment"][0] == 10.0
    assert float(terms["alignment"][1]) == pytest.approx(0.1, rel=1e-3)
    assert "alignment" not in make(context, decoder="lie")._terms(found, poses, torch.tensor([True, True]), valid)
    # One joint off by 3-4-0 cm adds 5 cm (Eq. 3.11); nothing beyond the valid frames counts.
    found = poses.clone()
    found[0, 0, 3:5] = torch.tensor([0.03, 0.04])
    found[:, 2:] = 9.0
    valid[:, 2:] = False
    value = float(model._terms(found, poses, torch.tensor([True, False]), valid)["joints"][1])
    assert value == pytest.approx(0.05 / 4, rel=0.02)


def test_the_weight_of_the_divergence_rises(context):
    model, batch = make(context), make_acted([12, 10])
    losses = [model.loss(batch, progress, rng()) for progress in (0.0, 0.5, 1.0)]
    kl = losses[0][1]["kl"]
    for (loss, logs), weight in zip(losses, (0.001, 0.0505, 0.1), strict=True):
        expected = logs["joints"] + 10 * logs["alignment"] + weight * kl
        assert torch.allclose(loss, expected, rtol=1e-4)


def test_true_poses_are_read_where_the_coin_says_so(context):
    """All forced: later true poses act on earlier outputs never, and the model's own outputs never."""
    batch = make_acted([12] * 40)
    values = {}
    for share in (0.0, 0.6, 1.0):
        model, reads = make(context, teacher_forcing=share), []
        model.decoder.register_forward_pre_hook(lambda _, given, reads=reads: reads.append(given[1]))
        model.loss(batch, 0.0, rng())
        true = torch.nn.functional.pad(to_poses(batch.joints, 20.0)[:, :-1], (0, 0, 1, 0))
        values[share] = (reads[-1] == true).flatten(1).all(1)
    assert not values[0.0].any()
    assert values[1.0].all()
    assert 15 <= int(values[0.6].sum()) <= 33  # 40 coins, three deviations around 24
    assert not values[0.6].all()


@pytest.mark.parametrize("decoder", DECODERS)
def test_every_weight_gets_a_finite_gradient(context, decoder):
    model = make(context, decoder=decoder)
    model.loss(make_acted([12, 9, 4]), 0.3, rng())[0].backward()
    for name, parameter in model.named_parameters():
        assert parameter.grad is not None, name
        assert torch.isfinite(parameter.grad).all()
        assert parameter.grad.abs().sum() > 0, name


def test_padding_and_neighbours_change_nothing(context):
    model, batch = make(context), make_acted([12, 7])
    condition = model.condition(batch.action[:, None].expand(2, 12), batch.frames)
    poses = to_poses(batch.joints, 20.0)
    alone = model.posterior_of(poses[1:, :7], condition[1:, :7])
    both = model.posterior_of(poses, condition)
    assert torch.allclose(both[0][1, :7], alone[0][0], atol=1e-6)
    batch.joints[1, 7:] = 50.0
    first = model.loss(batch, 0.0, rng())[0]
    batch.joints[1, 7:] = -50.0
    assert torch.allclose(first, model.loss(batch, 0.0, rng())[0])


def test_unknown_labels_are_left_out(context):
    model, batch = make(context, teacher_forcing=1.0), make_acted([12, 12, 12])
    batch.action[2] = -1
    kept = make_acted([12, 12])
    assert torch.allclose(model.loss(batch, 0.0, rng())[0], model.loss(kept, 0.0, rng())[0], atol=1e-6)


def test_the_time_counter_and_the_action(context):
    condition = make(context).condition(torch.tensor([[0, 0, 1, 1]]), torch.tensor([4]))
    assert condition[0].tolist() == [[1, 0, 0.25], [1, 0, 0.5], [0, 1, 0.75], [0, 1, 1.0]]


def test_it_overfits_two_motions_and_tells_them_apart(context):
    model, batch = make(context, width=48, kl_end=0.01), make_acted([16, 16])
    optimizer = torch.optim.Adam(model.parameters(), 5e-3)
    first = None
    for step in range(150):
        loss, logs = model.loss(batch, step / 150, rng(step))
        first = first or float(logs["joints"])
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimizer.step()
    assert float(logs["joints"]) < 0.15 * first


def test_the_baseline_has_no_latents(context):
    model = make(context, decoder="plain", baseline=True)
    _, logs = model.loss(make_acted([8, 8]), 0.0, rng())
    assert set(logs) == {"joints"}
    assert model.prior is None


@pytest.mark.parametrize(
    ("settings", "key"),
    [({"labels": ()}, "labels"), ({"decoder": "mlp"}, "decoder"), ({"teacher_forcing": 2.0}, "teacher_forcing")],
)
def test_bad_settings_are_named(settings, key):
    with pytest.raises(InputError, match=f"action2motion.{key}"):
        replace(SMALL, **settings)
