"""The judge of joints: what it must not see, what it must, and what its loss leaves out."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from source_tree import imports, reached

from motionary.corpus.demo import demo_clip
from motionary.errors import InputError
from motionary.language import STATE_DIM
from motionary.motion import canonicalize
from motionary.nn.layers import seeded
from motionary.systems.judges.joint_evaluator import JointEvaluator, JointEvaluatorConfig, similarity
from motionary.systems.judges.skeletal import View, channels

SMALL = JointEvaluatorConfig(width=24, num_layers=1, num_heads=2, dim=12, dropout=0.0)


def build(context, **changes):
    with seeded(0):
        return JointEvaluator(dataclasses.replace(SMALL, **changes), context).eval()


@pytest.fixture(scope="module")
def joints() -> torch.Tensor:
    """Four different motions of 64 frames (4, 64, 22, 3)."""
    return torch.stack([torch.from_numpy(demo_clip(i)[0].positions[:64]) for i in range(4)])


def described(joints, seed=0):
    """A batch of these motions, each with a caption of random states."""
    generator = torch.Generator().manual_seed(seed)
    size = len(joints)
    count = torch.arange(size) % 4 + 3
    states = torch.randn(size, int(count.max()), STATE_DIM, generator=generator)
    states *= (torch.arange(states.shape[1]) < count[:, None])[..., None]
    frames = torch.full((size,), joints.shape[1])
    return SimpleNamespace(
        joints=joints, frames=frames, states=states, state_count=count, text_key=torch.arange(size),
        clip=torch.arange(size),
    )  # fmt: skip


def turned(joints, angle):
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = joints.unbind(-1)
    return torch.stack([c * x + s * z, y, c * z - s * x], -1)


def test_a_view_does_not_see_place_heading_and_size_and_sees_the_rest(context, joints):
    view, frames = View(context.skeleton, 20.0, 10.0), torch.full((4,), 64)
    x, steps = view(joints, frames)
    assert x.shape == (4, 32, channels(22))
    assert steps.tolist() == [32] * 4
    moved = 1.3 * turned(joints, 2.1) + torch.tensor([3.0, 0.0, -2.0])
    torch.testing.assert_close(view(moved, frames)[0], x, atol=2e-4, rtol=1e-4)
    mirrored = joints.clone() * torch.tensor([-1.0, 1.0, 1.0])
    for left, right in context.skeleton.pairs:
        mirrored[:, :, [left, right]] = mirrored[:, :, [right, left]]
    assert (view(mirrored, frames)[0] - x).abs().mean() > 0.02  # left is not right
    higher = joints + torch.tensor([0.0, 0.3, 0.0])
    assert (view(higher, frames)[0] - x).abs().max() > 1  # the floor is seen


def test_a_view_s_root_in_closed_form(context):
    rest = torch.tensor(context.skeleton.rest, dtype=torch.float32)
    t = torch.arange(21) / 20
    walking = rest + torch.stack([0 * t, 0 * t, 0.5 * t], -1)[:, None]  # 0.5 m/s ahead
    spinning = torch.stack([turned(rest, float(angle)) for angle in t])  # 1 rad/s to the left
    x, steps = View(context.skeleton, 20.0, 10.0)(torch.stack([walking, spinning]), torch.tensor([21, 21]))
    assert steps.tolist() == [11, 11]
    speed, path, forward, turn = x[..., -7:].split([2, 2, 2, 1], -1)
    torch.testing.assert_close(speed[0, 1:], torch.tensor([0.0, 0.5]).expand(10, 2), atol=1e-4, rtol=0)
    torch.testing.assert_close(path[0, -1], torch.tensor([0.0, 0.25]), atol=1e-4, rtol=0)  # half a metre, in units of 2
    torch.testing.assert_close(turn[1, 1:, 0], torch.ones(10), atol=1e-3, rtol=0)
    torch.testing.assert_close(forward[1, -1], torch.tensor([np.sin(1.0), np.cos(1.0)]).float(), atol=1e-3, rtol=0)
    assert float(x[0, :, : 3 * 22].abs().max()) < 1e-3  # a body in its rest pose is at zero


def test_rate_and_tempo_say_which_frames_are_read(context, joints):
    slow, frames = View(context.skeleton, 20.0, 10.0), torch.full((4,), 64)
    fast = View(context.skeleton, 40.0, 10.0)
    doubled = torch.lerp(joints[:, :-1], joints[:, 1:], 0.5)
    both = torch.stack([joints[:, :-1], doubled], 2).flatten(1, 2)  # the same motion at 40 fps
    x, steps = fast(both, torch.full((4,), 126))
    torch.testing.assert_close(x, slow(joints[:, :63], frames - 1)[0], atol=1e-4, rtol=1e-4)
    read, steps = slow(joints, frames, tempo=torch.tensor([1.0, 2.0, 1.0, 0.5]))
    assert steps.tolist() == [32, 16, 32, 64]
    torch.testing.assert_close(read[1, :16, :66], slow(joints, frames)[0][1, ::2, :66], atol=1e-4, rtol=1e-4)


def test_other_bones_are_of_other_lengths_point_the_same_way_and_are_alike_on_both_sides(context, joints):
    view = View(context.skeleton, 20.0, 10.0)
    other = view.other_bones(joints, 0.2, torch.Generator().manual_seed(0))
    child, parent = (list(column) for column in zip(*view.bones, strict=True))
    before, after = joints[:, :, child] - joints[:, :, parent], other[:, :, child] - other[:, :, parent]
    factor = after.norm(dim=-1) / before.norm(dim=-1)
    torch.testing.assert_close(factor, factor[:, :1].expand_as(factor), atol=1e-3, rtol=1e-3)  # all frames alike
    torch.testing.assert_close(after, before * factor[..., None], atol=1e-3, rtol=1e-3)
    assert float(factor[:, 0].std()) > 0.1
    place = {joint: i for i, joint in enumerate(child)}
    for left, right in context.skeleton.pairs:
        torch.testing.assert_close(factor[:, 0, place[left]], factor[:, 0, place[right]], atol=1e-3, rtol=1e-3)
    torch.testing.assert_close(other[:, :, 0], joints[:, :, 0])


def test_embeddings_do_not_depend_on_padding_or_batch(context, joints):
    model, batch = build(context), described(joints)
    frames = torch.tensor([64, 40, 23, 4])
    motion, text = model.embed_joints(joints, frames), model.embed_states(batch.states, batch.state_count)
    assert motion.shape == text.shape == (4, 12)
    torch.testing.assert_close(motion.norm(dim=-1), torch.full((4,), 10.0))
    changed = joints.clone()
    changed[2, 23:] = 1e3
    torch.testing.assert_close(model.embed_joints(changed, frames)[2], motion[2])
    for item in range(4):
        alone = model.embed_joints(joints[item : item + 1, : int(frames[item])], frames[item : item + 1])
        torch.testing.assert_close(alone[0], motion[item], atol=1e-4, rtol=1e-4)
        count = batch.state_count[item : item + 1]
        alone = model.embed_states(batch.states[item : item + 1, : int(count)], count)
        torch.testing.assert_close(alone[0], text[item], atol=1e-4, rtol=1e-4)


def test_features_are_decoded_to_the_same_joints(context):
    motion = canonicalize(demo_clip(0)[0])
    features = context.make_codec().encode(motion)[:40]
    model = build(context)
    raw = torch.from_numpy(np.stack([features, features]))
    raw[1, 20:] = 0
    found = model.embed_motion(raw, torch.tensor([40, 20]))
    for row, count in enumerate((40, 20)):
        decoded = torch.from_numpy(motion.positions[None, :count])
        torch.testing.assert_close(found[row], model.embed_joints(decoded, torch.tensor([count]))[0], atol=1e-2, rtol=0)


def test_alike_texts_are_no_negatives(context, joints):
    batch = described(joints)
    batch.states[1] = 0
    batch.states[1, :3] = batch.states[0, :3] + 0.1 * torch.randn(
        3, STATE_DIM, generator=torch.Generator().manual_seed(1)
    )
    batch.state_count[1] = 3
    near = similarity(batch.states, batch.state_count)
    assert float(near[0, 1]) > 0.9
    assert float(near[0, 2]) < 0.5
    losses = {}
    for alike in (0.8, 1.0):
        model = build(context, alike=alike)
        losses[alike] = float(model.validate(batch)["loss"])
    batch.text_key[1] = 0  # equal captions
    assert losses[0.8] < losses[1.0]
    assert float(build(context, alike=1.0).validate(batch)["loss"]) == pytest.approx(losses[0.8])


def test_one_batch_is_learned_on_other_bodies_and_tempos(context):
    joints = torch.stack([torch.from_numpy(demo_clip(i)[0].positions[:40]) for i in range(6)])
    batch, model = described(joints), build(context)
    start = float(model.validate(batch)["loss"])
    optimizer = torch.optim.Adam(model.parameters(), 2e-3)
    model.train()
    for step in range(60):
        model.loss(batch, 0.0, torch.Generator().manual_seed(step))[0].backward()
        assert step or all(p.grad is not None for p in model.parameters())
        optimizer.step()
        optimizer.zero_grad()
    values = model.eval().validate(batch)
    assert float(values["loss"]) < 0.3 * start
    assert float(values["top1"]) == 1


def test_it_stands_on_nothing_that_generates():
    found = reached(["motionary.systems.judges.joint_evaluator"], imports())
    assert not {name for name in found if ".t2m" in name or ".tm2t" in name or "snippets" in name}


def test_wrong_values_are_named(context, joints):
    with pytest.raises(InputError, match=r"joint_evaluator\.num_heads|joint_evaluator\.width"):
        JointEvaluatorConfig(width=10, num_heads=4)
    with pytest.raises(InputError, match=r"joint_evaluator\.rate"):
        JointEvaluatorConfig(rate=0.0)
    with pytest.raises(InputError, match="at least 4 frames"):
        build(context).embed_joints(joints, torch.tensor([64, 3, 64, 64]))
