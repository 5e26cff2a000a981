"""Skeletons: shipped data, JSON, rigs by name, and what is refused."""

from __future__ import annotations

import json
import pickle

import numpy as np
import pytest

from motionary.errors import InputError
from motionary.motion import Skeleton
from motionary.motion.rigs import REQUIRED, find_roles
from motionary.motion.roles import read_mapping

ARMS_AND_LEGS = tuple(
    f"{side}{part}"
    for side in ("Left", "Right")
    for part in ("UpLeg", "Leg", "Foot", "ToeBase", "Shoulder", "Arm", "ForeArm", "Hand")
)
CGSPEED = ("Hips", "LHipJoint", "RHipJoint", "LowerBack", "Spine", "Spine1", "Neck", "Neck1", "Head", *ARMS_AND_LEGS)
MIXAMO = tuple(f"mixamorig:{n}" for n in ("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head", *ARMS_AND_LEGS))


@pytest.mark.parametrize(("name", "joints"), [("smpl22", 22), ("kit21", 21)])
def test_shipped_skeletons_are_whole(name, joints):
    skeleton = Skeleton.named(name)
    assert len(skeleton) == joints
    assert sorted(j for chain in skeleton.chains for j in chain[1:]) == list(range(1, joints))
    for left, right in skeleton.pairs:
        assert skeleton.parents[right] in (skeleton.parents[left], dict(skeleton.pairs).get(skeleton.parents[left]))
    rest = np.zeros((joints, 3))
    for j, p in enumerate(skeleton.parents[1:], 1):
        rest[j] = rest[p] + skeleton.offsets[j]
    assert all(rest[left, 0] > 0 > rest[right, 0] for left, right in skeleton.pairs)
    ankle, toe = skeleton.feet[:2]
    assert rest[toe, 2] > rest[ankle, 2]
    assert skeleton.directions is not None
    np.testing.assert_allclose(np.linalg.norm(skeleton.directions[1:], axis=-1), 1)
    assert set(REQUIRED) <= set(skeleton.roles)


@pytest.mark.parametrize("name", ["smpl22", "kit21"])
def test_json_and_pickle_keep_a_skeleton(name):
    skeleton = Skeleton.named(name)
    again = Skeleton.from_json(json.loads(json.dumps(skeleton.to_json())))
    assert again == skeleton
    assert hash(again) == hash(skeleton)
    assert pickle.loads(pickle.dumps(skeleton)) == skeleton
    assert skeleton.with_offsets(skeleton.offsets * 2) != skeleton


def test_smpl_roles_are_its_joint_names():
    skeleton = Skeleton.named("smpl22")
    assert skeleton.roles == {name: i for i, name in enumerate(skeleton.joints)}


@pytest.mark.parametrize("joints", [CGSPEED, MIXAMO])
def test_rigs_with_alike_names_are_told_apart(joints):
    roles = {role: joints[i].split(":")[-1] for role, i in find_roles(tuple(joints)).items()}
    assert len(roles) == 22
    assert roles["left_knee"] == "LeftLeg"
    assert roles["right_shoulder"] == "RightArm"
    assert roles["spine2"] == ("Spine" if joints is CGSPEED else "Spine1")
    assert roles["neck"] == ("Neck1" if joints is CGSPEED else "Neck")


def test_a_rig_gives_chains_pairs_feet_and_sides():
    smpl = Skeleton.named("smpl22")
    rig = Skeleton.from_rig("rig", smpl.joints, smpl.parents, smpl.offsets)
    assert rig.pairs == smpl.pairs
    assert (rig.feet, rig.hips, rig.shoulders) == (smpl.feet, smpl.hips, smpl.shoulders)
    assert sorted(j for chain in rig.chains for j in chain[1:]) == list(range(1, 22))
    reached = {0}
    for chain in rig.chains:
        assert chain[0] in reached
        reached |= set(chain)


def test_an_unknown_rig_can_still_be_described():
    rig = Skeleton.from_rig("worm", ("a", "b", "c"), (-1, 0, 1), np.eye(3))
    assert rig.roles == {}
    assert rig.chains == ((0, 1, 2),)


def test_a_mapping_file_names_joints_by_role(tmp_path):
    path = tmp_path / "map.json"
    path.write_text('{"head": "skull"}')
    assert read_mapping(path, ("body", "skull")) == {"head": 1}
    for text in (
        '{"head": "hat"}',
        '{"tail": "skull"}',
        '{"head": "skull", "neck": "skull"}',
        '{"head": 1}',
        "[",
        "[1]",
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=r"map\.json"):
            read_mapping(path, ("body", "skull"))


@pytest.mark.parametrize(
    "change",
    [
        {"parents": (-1, 2, 0)},
        {"parents": (-1, 0)},
        {"parents": ("x", 0, 1)},
        {"joints": ("a", "a", "b")},
        {"offsets": np.full((3, 3), np.nan)},
        {"offsets": np.zeros((2, 3))},
        {"offsets": "far"},
        {"directions": np.zeros((3, 2))},
        {"feet": (0, 1, 2)},
        {"hips": (0, 9)},
        {"chains": ((0, 1, 5),)},
    ],
)
def test_wrong_skeletons_are_refused(change):
    fine = Skeleton.from_rig("three", ("a", "b", "c"), (-1, 0, 1), np.eye(3)).to_json()
    with pytest.raises(InputError, match="three"):
        Skeleton.from_json({**fine, **change})


def test_unknown_and_missing_keys_are_named():
    plain = Skeleton.named("kit21").to_json()
    with pytest.raises(InputError, match="tail"):
        Skeleton.from_json({**plain, "tail": 1})
    del plain["feet"]
    with pytest.raises(InputError, match="feet"):
        Skeleton.from_json(plain)
    with pytest.raises(InputError, match="smpl22, kit21"):
        Skeleton.named("smpl23")
