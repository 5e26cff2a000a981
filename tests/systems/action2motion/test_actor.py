"""Motions of labels: equal seeds, transitions, starts, scales, interpolation, and what is refused."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import torch
from acted import LABELS, acted_context, make_acted

from motionary.errors import InputError
from motionary.nn.layers import seeded
from motionary.systems.action2motion.actor import Actor
from motionary.systems.action2motion.conditioned_vae import Action2Motion, Action2MotionConfig
from motionary.systems.action2motion.system import open_actor
from motionary.systems.action2motion.variants import order, variants_of
from motionary.systems.io import Trained, save_model

FINE = ("walk/old", "walk/young")


@pytest.fixture(scope="module")
def models(context):
    """Untrained variants: two on coarse labels, the baseline, and one on fine labels."""
    found = {}
    for name, own in variants_of(("glmi_m", "plain", "cond_gru"), ("lie",)).items():
        with seeded(len(found)):
            labels = FINE if own["fine"] else LABELS
            config = Action2MotionConfig(**{"labels": labels, "width": 16, "latent": 4, "upstream": 3} | own)
            found[name] = Action2Motion(config, acted_context(context))
    return found


@pytest.fixture(scope="module")
def actor(models):
    return Actor(models)


def test_a_motion_depends_on_its_own_plan_and_seed_alone(actor):
    one = actor.act([[("walk", 12)]], [7])[0]
    several = actor.act([[("raise", 20)], [("walk", 12)], [("walk", 12)]], [1, 7, 8])
    assert one.frames == 12
    assert np.allclose(several[1].positions, one.positions, atol=1e-5)
    assert not np.allclose(several[2].positions, one.positions, atol=1e-3)
    small = Actor(actor.models, chunk=1).act([[("raise", 20)], [("walk", 12)]], [1, 7])
    assert np.allclose(small[1].positions, one.positions, atol=1e-5)


def test_an_action_may_be_told_in_pieces(actor):
    whole, pieces = (actor.act([plan], [3])[0] for plan in ([("walk", 12)], [("walk", 5), ("walk", 7)]))
    assert np.array_equal(whole.positions, pieces.positions)
    switched = actor.act([[("walk", 5), ("raise", 7)]], [3])[0]
    assert np.array_equal(switched.positions[:5], whole.positions[:5])
    assert not np.allclose(switched.positions[5:], whole.positions[5:], atol=1e-4)


@pytest.mark.parametrize("variant", ["glmi_m", "plain", "cond_gru"])
def test_a_start_stands_as_it_is_and_is_gone_on_from(actor, variant):
    joints = make_acted([6, 6]).joints.numpy()
    motions = actor.act([[("walk", 9)]] * 2, [0, 1], starts=[joints[0], joints[1]], variant=variant)
    for motion, start in zip(motions, joints, strict=True):
        assert motion.frames == 15
        assert np.allclose(motion.positions[:6], start, atol=1e-5)
    again = actor.act([[("walk", 9)]], [1], starts=[joints[1]], variant=variant)[0]
    assert np.allclose(again.positions, motions[1].positions, atol=1e-5)
    unequal = actor.act([[("walk", 9)]] * 2, [0, 1], starts=[joints[0, :3], joints[1]], variant=variant)
    assert np.allclose(unequal[1].positions, again.positions, atol=1e-5)


def test_the_motion_after_a_start_depends_on_it(actor):
    joints = make_acted([6, 6]).joints.numpy()
    one, two = (actor.act([[("walk", 9)]], [1], starts=[start])[0] for start in joints)
    assert not np.allclose(one.positions[6:] - one.positions[5:6], two.positions[6:] - two.positions[5:6], atol=1e-4)


def test_a_scaled_body_makes_the_scaled_motion(actor):
    one, two = (actor.act([[("walk", 9)]], [1], scale=scale)[0] for scale in (1.0, 0.5))
    assert np.allclose(0.5 * one.positions, two.positions, atol=1e-6)
    assert np.allclose(0.5 * one.skeleton.bone_lengths, two.skeleton.bone_lengths)
    measured = np.linalg.norm(two.positions[:, 4] - two.positions[:, 1], axis=-1)
    assert np.allclose(measured, two.skeleton.bone_lengths[4], atol=1e-4)


def test_interpolation_goes_from_one_first_pose_to_the_other(actor):
    motions = actor.between("walk", 10, (4, 9), 5)
    first, last = (actor.act([[("walk", 10)]], [seed])[0] for seed in (4, 9))
    assert np.allclose(motions[0].positions, first.positions, atol=1e-5)
    assert np.allclose(motions[-1].positions[0], last.positions[0], atol=1e-5)
    steps = [np.abs(b.positions[0] - a.positions[0]).max() for a, b in pairwise(motions)]
    assert max(steps) < 0.7 * np.abs(first.positions[0] - last.positions[0]).max()


def test_the_usual_variant_knows_the_action(actor):
    assert actor.actions == (*LABELS, *FINE)
    assert actor.variants == ("glmi_m", "plain", "cond_gru", "lie_fine")
    fine = actor.act([[("walk/old", 8)]], [0])[0]
    assert np.array_equal(fine.positions, actor.act([[("walk/old", 8)]], [0], variant="lie_fine")[0].positions)
    assert actor.starts_from_pose("cond_gru")
    assert not actor.starts_from_pose("glmi_m")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"plans": [[("fly", 8)]]}, "action: fly: must be one of raise, walk, walk/old"),
        ({"plans": [[("walk", 4), ("walk/old", 4)]]}, "all coarse or all fine"),
        ({"plans": [[("walk", 0)]]}, "at least 1"),
        ({"plans": [[]]}, "at least 1"),
        ({"scale": 0}, "scale: 0: must be a number above 0"),
        ({"variant": "gan"}, "variant: gan: must be one of glmi_m"),
        ({"variant": "cond_gru"}, "pose to start from"),
        ({"seeds": [1, 2]}, "seeds: 2"),
    ],
)
def test_what_cannot_be_asked(actor, given, message):
    asked = {"plans": [[("walk", 8)]], "seeds": [0]} | given
    with pytest.raises(InputError, match=message):
        actor.act(asked.pop("plans"), asked.pop("seeds"), **asked)


def test_saved_variants_open_in_their_order(models, tmp_path, actor):
    for name, model in models.items():
        save_model(tmp_path / "action2motion" / name, "action2motion", model, model.context)
    opened = open_actor(Trained(tmp_path), "action2motion")
    assert opened.variants == actor.variants == tuple(order(list(models)[::-1]))
    made = opened.act([[("walk", 8)]], [2])[0]
    assert np.array_equal(made.positions, actor.act([[("walk", 8)]], [2])[0].positions)
    (tmp_path / "none").mkdir()
    with pytest.raises(InputError, match="names no action"):
        open_actor(Trained(tmp_path), "none")


def test_variants_are_known():
    assert variants_of(("cond_gru",), ())["cond_gru"] == {"decoder": "plain", "baseline": True, "fine": False}
    for wrong in ((("gan",), ()), ((), ()), ("plain", ())):
        with pytest.raises(InputError, match="action2motion"):
            variants_of(*wrong)


def test_torch_is_left_as_it_was(actor):
    torch.manual_seed(5)
    wanted = torch.rand(1)
    torch.manual_seed(5)
    actor.act([[("walk", 8)]], [2])
    assert torch.equal(torch.rand(1), wanted)
