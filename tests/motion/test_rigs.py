"""Who plays which role: by the tree alone, and against a wrong mapping."""

from __future__ import annotations

import numpy as np
import pytest

from motionary.motion import Skeleton
from motionary.motion.rigs import REQUIRED
from motionary.motion.roles import contradictions, disagreements, roles_of
from motionary.motion.tree import roles_by_tree

SMPL = Skeleton.named("smpl22")


def built(extra: str = "") -> tuple[list[str], list[int], np.ndarray]:
    """A person's tree with, by name, other joints between and beside: twist bones, fingers, helpers."""
    joints, parents, offsets = list(SMPL.joints), list(SMPL.parents), [tuple(o) for o in SMPL.offsets.tolist()]

    def between(below: str, share: float) -> None:
        j = joints.index(below)
        x, y, z = offsets[j]
        joints.append(f"{below}_twist")
        parents.append(parents[j])
        offsets.append((x * share, y * share, z * share))
        parents[j], offsets[j] = len(joints) - 1, (x * (1 - share), y * (1 - share), z * (1 - share))

    if "twist" in extra:
        for name in ("left_knee", "right_knee", "left_elbow", "right_elbow"):
            between(name, 0.4)
    if "fingers" in extra:
        for side, sign in (("left", 1), ("right", -1)):
            for finger in range(5):
                joints.append(f"{side}_finger{finger}")
                parents.append(joints.index(f"{side}_wrist"))
                offsets.append((0.09 * sign, 0.0, 0.02 * (finger - 2)))
    if "ends" in extra:
        joints += ["head_end", "left_eye", "right_eye"]
        parents += [joints.index("head")] * 3
        offsets += [(0, 0.15, 0), (0.03, 0.06, 0.08), (-0.03, 0.06, 0.08)]
    if "toes" in extra:
        for side in ("left", "right"):
            joints.append(f"{side}_toe_end")
            parents.append(joints.index(f"{side}_foot"))
            offsets.append((0.0, 0.0, 0.06))
    order = [0]
    for joint in order:  # grows: parents before children
        order += [k for k, parent in enumerate(parents) if parent == joint]
    new = {old: i for i, old in enumerate(order)}
    return [joints[j] for j in order], [-1 if j == 0 else new[parents[j]] for j in order], np.array(offsets)[order]


@pytest.mark.parametrize("extra", ["", "twist", "fingers", "ends", "toes", "twist fingers ends toes"])
@pytest.mark.parametrize("axes", ["xyz", "zxy", "xzy mirrored"])
def test_the_tree_alone_tells_the_roles(extra, axes):
    """Joints are called j0, j1, ...: names tell nothing. Any axes may be up; a mirrored rig has its sides swapped."""
    joints, parents, offsets = built(extra)
    turned = offsets[:, ["xyz".index(a) for a in axes[:3]]]
    found = roles_by_tree([f"j{i}" for i in range(len(joints))], parents, turned)
    assert set(REQUIRED) <= found.keys()
    swapped = axes.endswith("mirrored")
    other = {"left": "right", "right": "left"}
    for role in REQUIRED:
        side, _, part = role.partition("_")
        name = f"{other[side]}_{part}" if swapped and part else role
        assert joints[found[role]] == name
    assert joints[found["spine3"]] == "spine3"
    assert joints[found["left_foot"]].endswith("foot")


def test_names_say_the_sides_where_the_rest_pose_does_not():
    """Bones along one axis have no front; a letter in the names decides, and without one nothing is claimed."""
    joints, parents, offsets = built()
    along = np.zeros_like(offsets)
    along[:, 0] = np.linalg.norm(offsets, axis=-1)
    assert roles_by_tree([f"j{i}" for i in range(22)], parents, along) == {}
    letters = [f"b{i}_{'L' if 'left' in n else 'R' if 'right' in n else 'C'}" for i, n in enumerate(joints)]
    # With hips and shoulders on one spot no pair is a pair of limbs.
    along[[joints.index("left_hip"), joints.index("left_collar")], 2] = 0.1
    along[[joints.index("right_hip"), joints.index("right_collar")], 2] = -0.1
    found = roles_by_tree(letters, parents, along)
    assert {joints[found[role]] for role in REQUIRED} == set(REQUIRED)
    assert joints[found["left_knee"]] == "left_knee"


def test_trees_that_are_no_people_have_no_roles():
    assert roles_by_tree(["a", "b", "c"], [-1, 0, 1], np.eye(3)) == {}
    star = [-1, *[0] * 8]
    assert roles_by_tree([f"j{i}" for i in range(9)], star, np.ones((9, 3))) == {}


def test_the_upper_spine_is_where_the_arms_leave():
    """Whatever its name: here the chest has a joint above it."""
    joints, parents, offsets = built()
    names = ["Spine9" if n == "spine3" else n for n in joints]
    assert names[roles_of(tuple(names), parents, offsets)["spine3"]] == "Spine9"


def test_a_mapping_that_contradicts_the_tree_is_said():
    roles = dict(SMPL.roles)
    assert contradictions(roles, SMPL.joints, SMPL.parents) == []
    roles["left_knee"], roles["left_ankle"] = roles["left_ankle"], roles["left_knee"]
    assert "left_knee (left_ankle) is not below left_ankle (left_knee)" in contradictions(
        roles, SMPL.joints, SMPL.parents
    )


def test_a_spine_out_of_order_is_said():
    roles = dict(SMPL.roles)
    roles["spine1"], roles["spine3"] = roles["spine3"], roles["spine1"]
    assert any("is not below" in line for line in contradictions(roles, SMPL.joints, SMPL.parents))


def test_a_mapping_against_what_names_and_tree_say():
    known = SMPL.roles
    assert disagreements(known, known, SMPL.joints) == []
    assert disagreements({"spine1": known["spine2"]}, known, SMPL.joints) == []
    (slip,) = disagreements({"left_shoulder": known["left_collar"]}, known, SMPL.joints)
    assert slip.startswith("left_collar (left_shoulder) is left_collar")
    sides = {role: known[role.replace("left", "r8").replace("right", "left").replace("r8", "right")] for role in known}
    (swapped,) = disagreements(sides, known, SMPL.joints)
    assert "left and right" in swapped
    legs = {role: joint for role, joint in sides.items() if role.split("_")[-1] in ("hip", "knee", "ankle")}
    said = disagreements(dict(known) | legs, known, SMPL.joints)
    assert len(said) == 4
    assert said[-1] == "and 3 more"
